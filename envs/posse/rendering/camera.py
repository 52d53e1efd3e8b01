"""The view of a frame: world metres to pixels.

An arena is shown whole, unless the camera is told to follow the action there as well. On the open
plane the view follows the robots: it contains all of them, changes its scale rarely, and moves
smoothly in *simulated* time, so that it depends only on the states drawn.
"""

from __future__ import annotations

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
        arena: Side of the walled square, m; ``inf``: the open plane.
        whole: Whether an arena is always shown whole.

    Attributes:
        centre: Centre of the view, (2,) m.
        scale: Pixels per metre.
    """

    def __init__(self, viewport: tuple[int, int, int, int], arena: float, whole: bool = True) -> None:
        self.viewport = viewport
        self._arena = arena
        self._fixed = whole and math.isfinite(arena)
        self.reset()

    def reset(self) -> None:
        """Reset the view: the next :meth:`follow` does not smooth."""
        self.centre: Points = np.zeros(2)
        self._level: int | None = None
        self.scale = 1.0
        if self._fixed:
            self.scale = self._whole()

    def follow(self, points: Points, time: float) -> None:
        """Move towards a view that contains all points (K, 2) m, ``time`` s after the last call."""
        if self._fixed:
            return
        lowest, highest = points.min(axis=0), points.max(axis=0)
        middle = (lowest + highest) / 2
        pixels = np.array(self.viewport[2:], np.float64)
        least = _LEAST_SPAN / min(pixels)  # m per pixel
        needed = max(least, float(((highest - lowest + 2 * _MARGIN) / pixels).max()))
        if math.isfinite(self._arena):
            needed = max(least, min(needed, 1 / self._whole()))
        level = math.ceil(math.log(needed / least, _LEVEL) - 1e-9)
        # Zoom out at once when necessary; zoom in only by a full level.
        first = self._level is None
        if self._level is None or level > self._level or level < self._level - 1:
            self._level = level
        wanted = least * _LEVEL**self._level
        if math.isfinite(self._arena):  # not more than the arena, and nothing outside it
            wanted = min(wanted, 1 / self._whole())
            slack = np.maximum(self._arena / 2 + _MARGIN - pixels * wanted / 2, 0)
            middle = np.clip(middle, -slack, slack)
        if first:
            self.centre, self.scale = middle, 1 / wanted
            return
        self.centre = self.centre + (1 - math.exp(-time / _FOLLOW_TIME)) * (middle - self.centre)
        zoom = (1 - math.exp(-time / _ZOOM_TIME)) * math.log(wanted * self.scale)
        reach = np.abs(points - self.centre).max(axis=0) + _MARGIN / 2
        held = float((2 * reach / pixels).max())
        self.scale = min(self.scale / math.exp(zoom), 1 / held)

    def _whole(self) -> float:
        """Return the scale at which the arena fits, px per metre."""
        return float(min(self.viewport[2:]) / (self._arena + 2 * _MARGIN))

    def look(self, centre: npt.ArrayLike, scale: float) -> None:
        """Set the view: its centre (2,) m, and pixels per metre."""
        self.centre = np.array(centre, np.float64)
        self.scale = float(scale)

    def project(self, points: Points) -> Points:
        """Return the pixel coordinates (..., 2) of points (..., 2) m."""
        left, top, width, height = self.viewport
        x = left + width / 2 + (points[..., 0] - self.centre[0]) * self.scale
        y = top + height / 2 - (points[..., 1] - self.centre[1]) * self.scale
        return np.stack([x, y], axis=-1)

    def unproject(self, pixels: Points) -> Points:
        """Return the points (..., 2) m of pixel coordinates (..., 2)."""
        left, top, width, height = self.viewport
        x = (pixels[..., 0] - left - width / 2) / self.scale + self.centre[0]
        y = (top + height / 2 - pixels[..., 1]) / self.scale + self.centre[1]
        return np.stack([x, y], axis=-1)

    def bounds(self) -> tuple[Points, Points]:
        """Return the lower left and the upper right corner of the view, (2,) m each."""
        half = np.array(self.viewport[2:], np.float64) / (2 * self.scale)
        return self.centre - half, self.centre + half
