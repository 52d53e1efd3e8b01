"""The text of a frame: title, time, score, scale bar and key."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from posse.rendering.content.scene import Scene
from posse.rendering.layers import leader_mark
from posse.rendering.style import FAINT_INK, INK, PAPER, TASK_COLOURS, TASKS, TRACKER_RIM

if TYPE_CHECKING:
    from posse.rendering.canvas import Canvas

HEADER: Final = 40
"""Height of the line above the picture, points."""
FOOTER: Final = 30
"""Height of the line below it, points."""

_TITLE: Final = 21
_TEXT: Final = 17
_SMALL: Final = 14
_EDGE: Final = 14
_FIGURES: Final = 165  # points, that time and score take
_BAR_LENGTHS: Final = (0.5, 1, 2, 5, 10, 20, 50, 100)
_BAR_MOST: Final = 110  # points


Box = tuple[int, int, int, int]


def header(canvas: Canvas, box: Box, scene: Scene, title: str | None, point: float) -> None:
    """Write the title and the scenario on the left of a box, time and score on the right."""
    middle, name = box[1] + HEADER * point / 2, scene.scenario.name
    left, right = box[0] + _EDGE * point, box[0] + box[2] - _EDGE * point
    # A long title is written smaller, and the scenario's name is left out where there is no room.
    room = right - left - _FIGURES * point
    size = _TITLE * point
    size *= min(1.0, max(0.5, room / canvas.width_of(title or name, size)))
    left += canvas.text(title or name, (left, middle), size, INK) + 10 * point
    if title and left + canvas.width_of(name, _TEXT * point) < right - _FIGURES * point:
        canvas.text(name, (left, middle), _TEXT * point, FAINT_INK)
    # Columns of fixed width, so that changing digits do not move the text.
    columns = ((f"{scene.score:.2f}", 38, INK), ("score", 54, FAINT_INK), (f"{scene.time:.1f} s", 0, INK))
    for text, column, colour in columns:
        canvas.text(text, (right, middle), _TEXT * point, colour, anchor=1)
        right -= column * point


def note(canvas: Canvas, viewport: Box, text: str, point: float) -> None:
    """Write a remark on a patch of paper in the upper left corner of a picture."""
    left, top, _, _ = viewport
    size, edge = _SMALL * point, _EDGE * point
    width = canvas.width_of(text, size)
    canvas.box(left + edge - 4 * point, top + 4 * point, width + 8 * point, 1.4 * size, PAPER)
    canvas.text(text, (left + edge, top + 4 * point + 0.7 * size), size, FAINT_INK)


def tasks_of(scene: Scene) -> list[tuple[str, tuple[int, int, int]]]:
    """Return name and colour of the tasks that a team may tell.

    One without a leader has no exchange of leaders.
    """
    if scene.task is None:
        return []
    named = list(zip(TASKS, TASK_COLOURS, strict=True))
    return named if scene.leads is not None else named[:-1]


def footer(canvas: Canvas, box: Box, scene: Scene, scale: float, point: float) -> None:
    """Draw the scale bar (``scale`` in pixels per metre), and a key to the colours of the tasks."""
    start, top, width, height = box
    middle = top + height - FOOTER * point / 2
    fitting = [v for v in _BAR_LENGTHS if v * scale <= _BAR_MOST * point]
    length = fitting[-1] if fitting else _BAR_LENGTHS[0]
    left = start + _EDGE * point
    right = left + length * scale
    canvas.line((left, middle), (right, middle), 1.6 * point, INK)
    for end in (left, right):
        canvas.line((end, middle - 4 * point), (end, middle + 4 * point), 1.6 * point, INK)
    canvas.text(f"{length:g} m", (right + 7 * point, middle), _SMALL * point, INK)
    end = right + 7 * point + canvas.width_of(f"{length:g} m", _SMALL * point)
    right = start + width - _EDGE * point
    # Where there is no room beside the scale bar, the key is smaller.
    tasks = tasks_of(scene)
    words = [text for text, _ in tasks] + (["leader"] if scene.leads is not None else [])
    wide = sum(canvas.width_of(text, _SMALL * point) + 24 * point for text in words)
    if words:
        point *= min(1.0, max(0.6, (right - end) / (wide + 4 * point)))
    if scene.leads is not None:
        right -= canvas.text("leader", (right, middle), _SMALL * point, FAINT_INK, anchor=1)
        right -= 10 * point
        leader_mark(canvas, np.array([right, middle + 3.5 * point]), 4.5 * point)
        right -= 16 * point
    for text, colour in reversed(tasks):
        right -= canvas.text(text, (right, middle), _SMALL * point, FAINT_INK, anchor=1)
        right -= 9 * point
        canvas.disc((right, middle), 5 * point, TRACKER_RIM)
        canvas.disc((right, middle), 4 * point, colour)
        right -= 15 * point
