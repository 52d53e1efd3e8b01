"""Fields write columns, and one transposition writes the observations' rows.

A column is one number of a field for eight observers. Where each begins follows from the order of
the declarations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

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

_FEW: Final = 2
"""Up to so many columns are written faster one by one than by a transposition."""

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


def mate_writer(declarations: Declarations) -> Callable[..., Any]:
    """Return (c, v, m, columns), which writes the columns of team-mates."""
    return _writer("mate", declarations, "c, v, m", "mate", "{}")


def empty_writer(declarations: Declarations) -> Callable[..., Any]:
    """Return (o, k), which writes the place of a team-mate that nobody fills, from k on."""
    values = [float(d.unknown or 0.0) for d in declarations for _ in range(d.size)]
    lines = [f"    o[k + {q}] = np.float32({value})" for q, value in enumerate(values)]
    return _function("empty", declarations, "o, k", lines, {"np": np})


def _writer(
    name: str, declarations: Declarations, arguments: str, subject: str, value: str
) -> Callable[..., Any]:
    """Return a compiled function that calls those of the fields about a subject, one by one.

    Its lines are written out: to call one after the other from a tuple, numba would have to know
    all of them as one type.
    """
    lines: list[str] = []
    column = 0
    names: dict[str, Any] = {"np": np, "store": store, "eight": eight}
    for k, field in enumerate(declarations):
        if field.subject == subject:
            names[f"field_{k}"] = field.function
            parts = [f"part_{q}" for q in range(field.size)]
            lines.append(f"    {', '.join(parts)} = field_{k}({arguments})")
            lines += [
                f"    store(columns, {WIDTH * (column + q)}, {value.format(part)})"
                for q, part in enumerate(parts)
            ]
        column += field.size
    return _function(name, declarations, f"{arguments}, columns", lines, names)


def _function(
    name: str, declarations: Declarations, parameters: str, lines: list[str], names: dict[str, Any]
) -> Callable[..., Any]:
    """Return a compiled function of these lines, whose name says of which fields it is made."""
    names["__name__"] = __name__
    exec("\n".join([f"def write({parameters}):", *lines, "    return"]), names)
    write: Callable[..., Any] = names["write"]
    write.__qualname__ = f"{name}({', '.join(d.name for d in declarations)})"
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
    """Write columns to ``count`` observations, the first of robot i of world e, from k on."""
    _write(columns, width, e, i, count, across, observations, k, False, columns)


@compiled
def write_scattered(
    columns: FloatArray,
    width: int,
    e: int,
    i: int,
    count: int,
    across: int,
    observations: FloatArray,
    starts: FloatArray,
) -> None:
    """As :func:`write_rows`, to each observation from a place of its own on, (8,)."""
    _write(columns, width, e, i, count, across, observations, 0, True, starts)


@compiled
def _write(
    columns: FloatArray,
    width: int,
    e: int,
    i: int,
    count: int,
    across: int,
    observations: FloatArray,
    k: int,
    scattered: bool,
    starts: FloatArray,
) -> None:
    for block in range(width // WIDTH):
        first = WIDTH * block
        _write_block(
            columns, first, e, i, count, across, observations, k + first, scattered, starts
        )
    if width % WIDTH > _FEW:  # the last eight, some of them again
        first = width - WIDTH
        _write_block(
            columns, first, e, i, count, across, observations, k + first, scattered, starts
        )
    else:
        for column in range(width - width % WIDTH, width):
            for lane in range(count):
                o = observations[natural(e + lane * across), natural(i + lane * (1 - across))]
                start = natural(int(starts[lane])) if scattered else 0
                o[start + k + column] = columns[WIDTH * column + lane]


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
    scattered: bool,
    starts: FloatArray,
) -> None:
    """Write eight columns from ``first`` on to observations, from k on."""
    at = WIDTH * first
    a, b, c, d, f, g, h, j = transpose(
        load(columns, at), load(columns, at + WIDTH),
        load(columns, at + 2 * WIDTH), load(columns, at + 3 * WIDTH),
        load(columns, at + 4 * WIDTH), load(columns, at + 5 * WIDTH),
        load(columns, at + 6 * WIDTH), load(columns, at + 7 * WIDTH),
    )  # fmt: skip
    # Not in a loop: which of a tuple is meant would be looked up at run time.
    _write_row(a, 0, e, i, count, across, observations, k, scattered, starts)
    _write_row(b, 1, e, i, count, across, observations, k, scattered, starts)
    _write_row(c, 2, e, i, count, across, observations, k, scattered, starts)
    _write_row(d, 3, e, i, count, across, observations, k, scattered, starts)
    _write_row(f, 4, e, i, count, across, observations, k, scattered, starts)
    _write_row(g, 5, e, i, count, across, observations, k, scattered, starts)
    _write_row(h, 6, e, i, count, across, observations, k, scattered, starts)
    _write_row(j, 7, e, i, count, across, observations, k, scattered, starts)


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
    scattered: bool,
    starts: FloatArray,
) -> None:
    """Write eight numbers to one of ``count`` observations, if there are so many."""
    if lane < count:
        o = observations[natural(e + lane * across), natural(i + lane * (1 - across))]
        start = natural(int(starts[lane])) if scattered else 0
        store(o, start + k, row)
