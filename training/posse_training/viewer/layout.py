"""Where the parts of the viewer lie in its window."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from posse.rendering.picture import Box

LEAST_SIZE: Final = (320, 240)
"""Least width and height of the window, px."""
_BAR: Final = 40  # points
_PANEL: Final = 300  # points
_EDGE: Final = 14  # points
_CLOCK: Final = 150  # points, from the left edge of the bar to the track


@dataclass(frozen=True)
class Layout:
    """Boxes of a window: left, top, width, height, px.

    Attributes:
        size: Of the window.
        point: Pixels per point.
        picture: The world, with header and footer.
        bar: The line at the bottom.
        track: The timeline in it.
        panel: The numbers of the selected robot; ``None``: not shown.
    """

    size: tuple[int, int]
    point: float
    picture: Box
    bar: Box
    track: Box
    panel: Box | None


def lay_out(size: tuple[int, int], panel: bool) -> Layout:
    """Return the layout of a window of a size (width, height), with the panel or without."""
    width, height = (max(given, least) for given, least in zip(size, LEAST_SIZE, strict=True))
    point = min(max(min(width / 960, height / 640), 0.75), 1.8)
    bar = round(_BAR * point)
    side = min(round(_PANEL * point), width // 2) if panel else 0
    top = height - bar
    left, right = round(_CLOCK * point), round(_EDGE * point)
    return Layout(
        (width, height),
        point,
        (0, 0, width - side, top),
        (0, top, width, bar),
        (left, top, width - left - right, bar),
        (width - side, 0, side, top) if panel else None,
    )


def contains(box: Box | None, place: tuple[float, float]) -> bool:
    """Return whether a box contains a pixel."""
    if box is None:
        return False
    left, top, width, height = box
    return left <= place[0] < left + width and top <= place[1] < top + height
