"""The view of a frame: world metres to pixels.

The view contains all working robots, changes its scale rarely, and moves smoothly in *simulated*
time, so that it depends only on the states drawn. In an arena it stays on the arena.
"""

import math
from typing import Final

import numpy as np
import numpy.typing as npt

Points = npt.NDArray[np.float64]

_MARGIN: Final = 0.7  # m, between the outermost robot and the edge
_LEAST_SPAN: Final = 8.0  # m, along the shorter side: a team in formation, with margin
_LEVEL: Final = 1.25  # ratio of successive scales
_ZOOM_TIME: Final = 1.0  # s, time constant of a change of scale
_FOLLOW_TIME: Final = 0.8  # s, time constant of a change of position


class Camera:
    """A view of the plane in a rectangle of pixels, x to the right and y up.

    Args:
        viewport: Left, top, width and height of the rectangle, px.
        half_sides: Half the width and half the height of the arena, m; ``inf``: the open plane.

    Attributes:
        centre: Centre of the view, (2,) m.
        scale: Pixels per metre.
    """

    def __init__(self, viewport: tuple[int, int, int, int], half_sides: tuple[float, float]) -> None:
        self.viewport = viewport
        self._corner: Points = np.array(half_sides)
        self.centre: Points = np.zeros(2)
        self.scale = 1.0
        self._level = 0

    def follow(self, points: Points, time: float) -> None:
        """Move towards a view that contains all points (K, 2) m; ``time``: since the last call, s; inf: at once."""
        pixels = np.array(self.viewport[2:], np.float64)
        lowest, highest = points.min(axis=0), points.max(axis=0)
        middle = (lowest + highest) / 2
        least = _LEAST_SPAN / min(pixels)  # m per pixel
        needed = max(least, float(((highest - lowest + 2 * _MARGIN) / pixels).max()))
        level = math.ceil(math.log(needed / least, _LEVEL) - 1e-9)
        if math.isinf(time) or not 0 <= self._level - level <= 1:  # zoom out at once, and in only by more than a level
            self._level = level
        wanted = least * _LEVEL**self._level
        slack = np.maximum(self._corner + _MARGIN - pixels * wanted / 2, 0)  # nothing outside the arena
        middle = np.clip(middle, -slack, slack)
        self.centre = self.centre + (1 - math.exp(-time / _FOLLOW_TIME)) * (middle - self.centre)
        zoom = (1 - math.exp(-time / _ZOOM_TIME)) * math.log(wanted * self.scale)
        reach = np.abs(points - self.centre).max(axis=0) + _MARGIN / 2
        held = float((2 * reach / pixels).max())
        self.scale = min(self.scale / math.exp(zoom), 1 / held)

    def project(self, points: npt.ArrayLike) -> Points:
        """Return the pixels (..., 2), right and down, of points (..., 2) m."""
        left, top, width, height = self.viewport
        middle = np.array([left + width / 2, top + height / 2])
        return middle + (np.asarray(points) - self.centre) * (self.scale, -self.scale)

    def floor(self) -> Points:
        """Return the lower left and the upper right corner (2, 2) m of the arena, or of the plane in view."""
        if np.isfinite(self._corner).all():
            return np.stack([-self._corner, self._corner])
        half = np.array(self.viewport[2:], np.float64) / (2 * self.scale)
        return np.stack([self.centre - half, self.centre + half])
