"""An anti-aliased surface: drawn at a higher resolution, then averaged down.

The only module of the drawing that uses pygame. It needs no display.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from functools import cache
from typing import Final

import numpy as np
import numpy.typing as npt

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")

import pygame
import pygame.gfxdraw

from posse.rendering.style import Colour

_OVERSAMPLED: Final = 3
_FARTHEST: Final = 30_000

Point = Sequence[float] | npt.NDArray[np.float64]


@cache
def _font(size: int) -> pygame.font.Font:
    """Return pygame's bundled font, so that frames are equal on every machine."""
    pygame.font.init()
    return pygame.font.Font(None, size)


class Canvas:
    """The surface of a frame. Coordinates and lengths are in pixels of the finished frame.

    Args:
        size: Width and height, px.
        oversampled: Resolution of the drawing, as a multiple of the frame's; at least 1.
    """

    def __init__(self, size: tuple[int, int], oversampled: int = _OVERSAMPLED) -> None:
        self.size = size
        width, height = size
        self._k = oversampled
        self._large = pygame.Surface((width * self._k, height * self._k), 0, 32)
        self._frame = pygame.Surface(size, 0, 32)

    def clip(self, box: tuple[int, int, int, int] | None) -> None:
        """Clip drawing to (left, top, width, height); ``None``: no clipping."""
        self._large.set_clip(None if box is None else tuple(v * self._k for v in box))

    def fill(self, colour: Colour) -> None:
        """Fill the clipped area."""
        self._large.fill(colour)

    def box(self, left: float, top: float, width: float, height: float, colour: Colour) -> None:
        """Fill a rectangle."""
        k = self._k
        edges = [round(v * k) for v in (left, top, left + width, top + height)]
        rect = (edges[0], edges[1], edges[2] - edges[0], edges[3] - edges[1])
        pygame.draw.rect(self._large, colour, rect)

    def disc(self, centre: Point, radius: float, colour: Colour) -> None:
        """Fill a disc."""
        place = self._place(centre)
        if self._in_reach(place, radius):
            pygame.draw.circle(self._large, colour, place, round(radius * self._k))

    def ring(self, centre: Point, radius: float, width: float, colour: Colour) -> None:
        """Draw a circle whose line lies inside ``radius``."""
        place = self._place(centre)
        if self._in_reach(place, radius):
            line = max(1, round(width * self._k))
            pygame.draw.circle(self._large, colour, place, round(radius * self._k), line)

    def line(self, start: Point, end: Point, width: float, colour: Colour, opacity: float = 1.0) -> None:
        """Draw a straight line with square ends, of an opacity in [0, 1]."""
        (x0, y0), (x1, y1) = self._place(start), self._place(end)
        length = math.hypot(x1 - x0, y1 - y0)
        if length == 0 or not (self._is_near(x0, y0) and self._is_near(x1, y1)):
            return
        half = max(width * self._k, 1.0) / 2 / length
        dx, dy = (y1 - y0) * half, (x0 - x1) * half
        corners = [(x0 + dx, y0 + dy), (x1 + dx, y1 + dy), (x1 - dx, y1 - dy), (x0 - dx, y0 - dy)]
        if opacity >= 1:
            pygame.draw.polygon(self._large, colour, corners)
        else:
            whole = [(round(x), round(y)) for x, y in corners]
            pygame.gfxdraw.filled_polygon(self._large, whole, (*colour, round(255 * opacity)))

    def dashes(self, start: Point, end: Point, width: float, dash: float, colour: Colour) -> None:
        """Draw a dashed line, strokes and gaps of length ``dash``."""
        (x0, y0), (x1, y1) = start, end
        length = math.hypot(x1 - x0, y1 - y0)
        for k in range(math.ceil(length / (2 * dash))):
            a, b = 2 * k * dash / length, min(1.0, (2 * k + 1) * dash / length)
            first = (x0 + a * (x1 - x0), y0 + a * (y1 - y0))
            self.line(first, (x0 + b * (x1 - x0), y0 + b * (y1 - y0)), width, colour)

    def polygon(self, corners: Sequence[Point] | npt.NDArray[np.float64], colour: Colour) -> None:
        """Fill a polygon."""
        pygame.draw.polygon(self._large, colour, self._places(corners))

    def outline(self, corners: npt.NDArray[np.float64], width: float, colour: Colour, closed: bool = True) -> None:
        """Draw the outline of a polygon, or an open line through its corners."""
        line = max(1, round(width * self._k))
        pygame.draw.lines(self._large, colour, closed, self._places(corners), line)

    def dashed_ring(self, centre: Point, radius: float, width: float, dash: float, colour: Colour) -> None:
        """Draw a circle of strokes and gaps of about the length ``dash``."""
        strokes = max(4, round(math.pi * radius / dash))
        for k in range(strokes):
            angles = np.linspace(0, math.pi / strokes, 4) + 2 * math.pi * k / strokes
            self.arc(centre, radius, angles, width, colour)

    def arc(self, centre: Point, radius: float, angles: npt.NDArray[np.float64], width: float, colour: Colour) -> None:
        """Draw a part of a circle through given angles, rad, y up."""
        rim = np.stack([np.cos(angles), -np.sin(angles)], axis=-1)
        self.outline(np.asarray(centre, np.float64) + radius * rim, width, colour, closed=False)

    def width_of(self, text: str, size: float) -> float:
        """Return the width that a line of text will have, px."""
        return _font(round(size * self._k)).size(text)[0] / self._k

    def text(self, text: str, place: tuple[float, float], size: float, colour: Colour, anchor: float = 0) -> float:
        """Write a line of text; return its width, px.

        ``place`` is the middle of its height at its left end (``anchor`` 0), its centre (0.5) or
        its right end (1).
        """
        image = _font(round(size * self._k)).render(text, True, colour)
        width, height = image.get_size()
        x, y = self._place(place)
        self._large.blit(image, (round(x - anchor * width), round(y - height / 2)))
        return width / self._k

    def finish(self) -> pygame.Surface:
        """Return the frame; valid until the next call."""
        pygame.transform.smoothscale(self._large, self.size, self._frame)
        return self._frame

    def _place(self, point: Point) -> tuple[float, float]:
        return float(point[0]) * self._k, float(point[1]) * self._k

    def _places(self, corners: Sequence[Point] | npt.NDArray[np.float64]) -> list[list[float]]:
        places = np.asarray(corners, np.float64) * self._k
        return np.clip(places, -_FARTHEST, _FARTHEST).tolist()  # type: ignore[no-any-return]

    def _is_near(self, x: float, y: float) -> bool:
        """Return whether a point is within the range of pygame's 16-bit coordinates."""
        return abs(x) < _FARTHEST and abs(y) < _FARTHEST

    def _in_reach(self, place: tuple[float, float], radius: float) -> bool:
        """Return whether a disc overlaps the canvas: far ones overflow pygame's integers."""
        reach = radius * self._k + 1
        width, height = self._large.get_size()
        x, y = place
        return -reach < x < width + reach and -reach < y < height + reach


def pixels(surface: pygame.Surface) -> npt.NDArray[np.uint8]:
    """Return a copy of a surface as (H, W, 3) uint8."""
    width, height = surface.get_size()
    flat = np.frombuffer(pygame.image.tobytes(surface, "RGB"), np.uint8)
    return flat.reshape(height, width, 3).copy()
