"""Scores over time as a few lines of text, with the line of a baseline."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

_BARS: Final = " ▁▂▃▄▅▆▇█"
_LINE: Final = "╌"
_MARGIN: Final = 0.1
"""Room below the lowest value, as a share of the range."""


def sparkline(scores: Sequence[float], line: float | None = None, *, width: int = 40, height: int = 4) -> list[str]:
    """Return the latest scores as bars, row by row from the top; the line is dashed.

    The rows span the lowest to the highest value, and state both, and the line's where it is drawn.

    Args:
        scores: At least one; as many of the latest as fit are shown.
        line: Value of the baseline; ``None``: no line.
        width: Characters of a row, without the stated value.
        height: Rows.
    """
    shown = list(scores)[-width:]
    values = [*shown, *([] if line is None else [line])]
    span = max(max(values) - min(values), 1e-3) * (1 + _MARGIN)
    top = max(values)
    bottom = top - span

    def level(value: float) -> float:
        return (value - bottom) / span * height

    at = None if line is None else height - 1 - min(height - 1, int(level(line)))
    rows = []
    for row in range(height):
        base = height - 1 - row
        eighths = (min(8, max(0, round(8 * (level(score) - base)))) for score in shown)
        bars = "".join(_BARS[k] for k in eighths).ljust(width)
        if row == at:
            bars = bars.replace(" ", _LINE)
        stated = {0: top, height - 1: min(values)}.get(row)
        if row == at:
            stated = line
        rows.append(bars + ("" if stated is None else f" {stated:.3f}"))
    return rows
