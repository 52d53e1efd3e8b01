"""Fields write columns, and one transposition writes the observations' rows.

A column is one number of a field for eight observers. Where each begins follows from the order of
the declarations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from posse.numeric import (
    WIDTH,
    FloatArray,
    Lanes,
    compiled,
    eight,
    load,
    store,
    transpose,
)
from posse.rules.discs import natural
from posse.signals.fields import FieldDeclaration

Declarations = Sequence[FieldDeclaration]


def width_of(declarations: Declarations) -> int:
    """Return how many numbers fields are together."""
    return sum(d.size for d in declarations)


def settings_writer(declarations: Declarations) -> Callable[..., Any]:
    """Return (c, columns), which writes the columns that are the same always."""
    return _writer("settings", declarations, "c", "setting", "eight(np.float32({}))")


def own_writer(declarations: Declarations) -> Callable[..., Any]:
    """Return (c, v, columns), which writes the other columns of observers."""
    return _writer("own", declarations, "c, v", "self", "{}")


def _writer(
    name: str, declarations: Declarations, arguments: str, subject: str, value: str
) -> Callable[..., Any]:
    """Return a compiled function that calls those of the fields about a subject, one by one.

    Its lines are written out: to call one after the other from a tuple, numba would have to know
    all of them as one type.
    """
    lines, names, column = [f"def write({arguments}, columns):"], [], 0
    functions: dict[str, Any] = {"np": np, "store": store, "eight": eight}
    for k, field in enumerate(declarations):
        if field.subject == subject:
            functions[f"field_{k}"] = field.function
            names.append(field.name)
            parts = [f"part_{q}" for q in range(field.size)]
            lines.append(f"    {', '.join(parts)} = field_{k}({arguments})")
            lines += [
                f"    store(columns, {WIDTH * (column + q)}, {value.format(part)})"
                for q, part in enumerate(parts)
            ]
        column += field.size
    functions["__name__"] = __name__
    exec("\n".join(lines), functions)
    write: Callable[..., Any] = functions["write"]
    write.__qualname__ = f"{name}({', '.join(names)})"
    return compiled(write)


@compiled
def write_rows(
    columns: FloatArray,
    width: int,
    e: int,
    i: int,
    count: int,
    across: int,
    observations: FloatArray,
    k: int,
) -> None:
    """Write columns to ``count`` observations, the first of them of robot i of world e, from k on.

    The last eight columns may overlap those before them.
    """
    for block in range(width // WIDTH):
        _write_block(columns, WIDTH * block, e, i, count, across, observations, k)
    if width % WIDTH != 0:
        _write_block(columns, width - WIDTH, e, i, count, across, observations, k)


@compiled
def _write_block(
    columns: FloatArray,
    first: int,
    e: int,
    i: int,
    count: int,
    across: int,
    observations: FloatArray,
    k: int,
) -> None:
    """Write eight columns from ``first`` on to their places in observations."""
    at = WIDTH * first
    a, b, c, d, f, g, h, j = transpose(
        load(columns, at), load(columns, at + WIDTH),
        load(columns, at + 2 * WIDTH), load(columns, at + 3 * WIDTH),
        load(columns, at + 4 * WIDTH), load(columns, at + 5 * WIDTH),
        load(columns, at + 6 * WIDTH), load(columns, at + 7 * WIDTH),
    )  # fmt: skip
    # Not in a loop: which of a tuple is meant would be looked up at run time.
    _write_row(a, 0, e, i, count, across, observations, k + first)
    _write_row(b, 1, e, i, count, across, observations, k + first)
    _write_row(c, 2, e, i, count, across, observations, k + first)
    _write_row(d, 3, e, i, count, across, observations, k + first)
    _write_row(f, 4, e, i, count, across, observations, k + first)
    _write_row(g, 5, e, i, count, across, observations, k + first)
    _write_row(h, 6, e, i, count, across, observations, k + first)
    _write_row(j, 7, e, i, count, across, observations, k + first)


@compiled
def _write_row(
    row: Lanes,
    lane: int,
    e: int,
    i: int,
    count: int,
    across: int,
    observations: FloatArray,
    k: int,
) -> None:
    """Write eight numbers to one of ``count`` observations, if there are so many."""
    if lane < count:
        o = observations[natural(e + lane * across), natural(i + lane * (1 - across))]
        store(o, k, row)
