"""Draws the viewer: the picture, the timeline, the panel, the help."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from posse.rendering.canvas import Canvas
from posse.rendering.key import Entry
from posse.rendering.style import CONTACT, FAINT_INK, GRID, GROUND, INK, PAPER
from posse_training.viewer.keys import BINDINGS, MOUSE
from posse_training.viewer.layout import Layout
from posse_training.viewer.panel import Line

_TEXT: Final = 15
_SMALL: Final = 13
_EDGE: Final = 14
_ROW: Final = 17


def draw_timeline(
    canvas: Canvas,
    layout: Layout,
    *,
    playing: bool,
    step: float,
    first: int,
    played: int,
    end: int,
    control_step: float,
    contacts: Sequence[int],
) -> None:
    """Draw the bar at the bottom: play or pause, the time, what has been played, contacts."""
    p = layout.point
    left, top, width, height = layout.bar
    middle = top + height / 2
    canvas.box(*layout.bar, PAPER)
    canvas.box(left, top, width, 1, GRID)
    x = left + _EDGE * p
    if playing:
        canvas.box(x, middle - 6 * p, 4 * p, 12 * p, INK)
        canvas.box(x + 7 * p, middle - 6 * p, 4 * p, 12 * p, INK)
    else:
        arrow = [(x, middle - 7 * p), (x + 11 * p, middle), (x, middle + 7 * p)]
        canvas.polygon(arrow, INK)
    clock = f"{step * control_step:.1f} / {end * control_step:g} s"
    canvas.text(clock, (x + 22 * p, middle), _TEXT * p, INK)
    start, _, length, _ = layout.track

    def place(k: float) -> float:
        return place_of(layout, k, end)

    canvas.line((start, middle), (start + length, middle), 3 * p, GRID)
    canvas.line((place(first), middle), (place(played), middle), 3 * p, FAINT_INK)
    for k in contacts:
        canvas.line((place(k), middle - 9 * p), (place(k), middle - 4 * p), 2 * p, CONTACT)
    canvas.disc((place(step), middle), 6 * p, INK)


def place_of(layout: Layout, step: float, end: int) -> float:
    """Return where a step lies on the timeline, px from the left."""
    start, _, length, _ = layout.track
    return start + length * min(max(step / max(end, 1), 0.0), 1.0)


def step_at(layout: Layout, x: float, end: int) -> float:
    """Return the step at a pixel of the timeline."""
    start, _, length, _ = layout.track
    return min(max((x - start) / max(length, 1), 0.0), 1.0) * end


def rows_of(layout: Layout) -> int:
    """Return how many lines the panel shows."""
    if layout.panel is None:
        return 0
    return int((layout.panel[3] / layout.point - 2 * _EDGE - 24) // _ROW)


def draw_panel(canvas: Canvas, layout: Layout, title: str, lines: Sequence[Line], scroll: int) -> None:
    """Draw the panel: a title, and the lines from a number on."""
    if layout.panel is None:
        return
    p = layout.point
    left, top, width, height = layout.panel
    canvas.box(*layout.panel, PAPER)
    canvas.box(left, top, 1, height, GRID)
    canvas.clip(layout.panel)
    inner, right = left + _EDGE * p, left + width - _EDGE * p
    canvas.text(title, (inner, top + 20 * p), 19 * p, INK)
    y = top + 46 * p
    rows = rows_of(layout)
    for line in lines[scroll : scroll + rows]:
        if line.is_heading:
            canvas.box(inner, y - 8.5 * p, right - inner, 1, GRID)
            canvas.text(line.name, (inner, y), _SMALL * p, INK)
        else:
            colour = INK if line.known else FAINT_INK
            canvas.text(line.name, (inner, y), _SMALL * p, FAINT_INK)
            value = f"{line.value} {line.unit}".rstrip()
            room = right - inner - canvas.width_of(line.name, _SMALL * p) - 8 * p
            size = _SMALL * p * min(1.0, room / max(canvas.width_of(value, _SMALL * p), 1.0))
            canvas.text(value, (right, y), max(size, 7.0), colour, anchor=1)
        y += _ROW * p
    if len(lines) > rows:
        share, reach = rows / len(lines), height - 60 * p
        at = top + 40 * p + reach * scroll / len(lines)
        canvas.box(left + width - 5 * p, at, 3 * p, reach * share, GRID)
    canvas.clip(None)


def draw_message(canvas: Canvas, layout: Layout, text: str) -> None:
    """Write a message over the picture, in as many lines as it needs."""
    p, (left, top, width, height) = layout.point, layout.picture
    size, lines, line = _TEXT * p, [], ""
    for word in text.split():
        longer = f"{line} {word}".strip()
        if line and canvas.width_of(longer, size) > width - 6 * _EDGE * p:
            lines.append(line)
            line = word
        else:
            line = longer
    lines.append(line)
    tall = len(lines) * 1.4 * size + 2 * _EDGE * p
    y = top + (height - tall) / 2
    canvas.box(left + _EDGE * p, y, width - 2 * _EDGE * p, tall, INK)
    canvas.box(left + _EDGE * p + 2, y + 2, width - 2 * _EDGE * p - 4, tall - 4, PAPER)
    for k, each in enumerate(lines):
        at = y + _EDGE * p + (k + 0.5) * 1.4 * size
        canvas.text(each, (left + width / 2, at), size, INK, anchor=0.5)


def draw_help(canvas: Canvas, layout: Layout, entries: Sequence[Entry]) -> None:
    """Draw the help over everything: keys on the left, the legend on the right."""
    width, height = layout.size
    canvas.box(0, 0, width, height, GROUND)
    keys = [*((each.keys, each.text) for each in BINDINGS), *MOUSE]
    rows = max(len(keys), len(entries)) + 2.5
    row = min(height / rows, 26 * layout.point)
    half = width / 2
    size = 0.62 * row
    edge = min(24.0, width / 40)
    first = max(canvas.width_of(name, size) for name, _ in keys) + 1.2 * size
    longest = first + max(canvas.width_of(text, size) for _, text in keys)
    unit = row / 26
    sample = 44 * unit
    legend = sample + max(canvas.width_of(entry.text, size) for entry in entries)
    shrink = min(1.0, (half - 1.5 * edge) / max(longest, legend))
    size, first, sample, unit = (v * shrink for v in (size, first, sample, unit))
    y = 1.1 * row
    canvas.text("Keys and mouse", (edge, y), 1.25 * size, INK)
    canvas.text("What is drawn", (half + edge / 2, y), 1.25 * size, INK)
    canvas.text("H or Esc: back", (width - edge, y), size, FAINT_INK, anchor=1)
    for k, (name, text) in enumerate(keys):
        at = y + (k + 1.2) * row
        canvas.text(name, (edge, at), size, INK)
        canvas.text(text, (edge + first, at), size, FAINT_INK)
    for k, entry in enumerate(entries):
        at = y + (k + 1.2) * row
        x = half + edge / 2
        entry.sample(canvas, x + 17 * unit, at, unit)
        canvas.text(entry.text, (x + sample, at), size, FAINT_INK)
