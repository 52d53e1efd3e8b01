"""The text of a frame: title, time, score, scale bar and key."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from posse.rendering.layers import leader_mark
from posse.rendering.scene import Scene
from posse.rendering.style import FAINT_INK, INK, TASK_COLOURS, TASKS, TRACKER_RIM

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
_BAR_LENGTHS: Final = (0.5, 1, 2, 5, 10, 20, 50, 100)
_BAR_MOST: Final = 110  # points


def header(canvas: Canvas, scene: Scene, title: str | None, point: float) -> None:
    """Write the title and the scenario on the left, time and score on the right."""
    width, middle, name = canvas.size[0], HEADER * point / 2, scene.scenario.name
    left = _EDGE * point
    left += canvas.text(title or name, (left, middle), _TITLE * point, INK) + 10 * point
    if title:
        canvas.text(name, (left, middle), _TEXT * point, FAINT_INK)
    # Columns of fixed width, so that changing digits do not move the text.
    right = width - _EDGE * point
    columns = (
        (f"{scene.score:.2f}", 38, INK),
        ("score", 54, FAINT_INK),
        (f"{scene.time:.1f} s", 0, INK),
    )
    for text, column, colour in columns:
        canvas.text(text, (right, middle), _TEXT * point, colour, anchor=1)
        right -= column * point


def footer(canvas: Canvas, scene: Scene, scale: float, point: float) -> None:
    """Draw the scale bar (``scale`` in pixels per metre), and a key to the colours of the tasks."""
    width, height = canvas.size
    middle = height - FOOTER * point / 2
    fitting = [v for v in _BAR_LENGTHS if v * scale <= _BAR_MOST * point]
    length = fitting[-1] if fitting else _BAR_LENGTHS[0]
    left, right = _EDGE * point, _EDGE * point + length * scale
    canvas.line((left, middle), (right, middle), 1.6 * point, INK)
    for end in (left, right):
        canvas.line((end, middle - 4 * point), (end, middle + 4 * point), 1.6 * point, INK)
    canvas.text(f"{length:g} m", (right + 7 * point, middle), _SMALL * point, INK)
    entries = []
    if scene.task is not None:
        entries += list(zip(TASKS, TASK_COLOURS, strict=True))
    right = width - _EDGE * point
    if scene.leads is not None:
        right -= canvas.text("leader", (right, middle), _SMALL * point, FAINT_INK, anchor=1)
        right -= 10 * point
        leader_mark(canvas, np.array([right, middle + 3.5 * point]), 4.5 * point)
        right -= 16 * point
    for text, colour in reversed(entries):
        right -= canvas.text(text, (right, middle), _SMALL * point, FAINT_INK, anchor=1)
        right -= 9 * point
        canvas.disc((right, middle), 5 * point, TRACKER_RIM)
        canvas.disc((right, middle), 4 * point, colour)
        right -= 15 * point
