"""Fields give columns, and a transposition writes them to the observations' rows.

A column is one number of a field for eight observers. Where in an observation each belongs follows
from the order of the declarations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from posse.numeric import WIDTH, FloatArray, Lanes, compiled, eight, store, transpose, written
from posse.rules.discs import natural
from posse.signals.observation.fields import FieldDeclaration

_FEW: Final = 2
"""Number of columns up to which writing single numbers is faster than a transposition."""

Declarations = Sequence[FieldDeclaration]


class Observers(NamedTuple):
    """At most eight robots, the first of them robot i of world e.

    They are one robot of several worlds (``across`` is 1) or several of one world (0).
    """

    e: int
    i: int
    number: int
    across: int


class Rows(NamedTuple):
    """Where to write in the observations of eight robots."""

    observers: Observers
    observations: FloatArray
    """(E, rows, F)."""
    start: int
    """Place in an observation that the first column goes to."""
    starts: FloatArray
    """(8,) or more: of each observer by itself, to be added where ``scattered``."""
    scattered: bool


def width_of(declarations: Declarations) -> int:
    """Return the total size of fields."""
    return sum(d.size for d in declarations)


def row_writer(declarations: Declarations, parameters: tuple[str, ...]) -> Callable[..., Any]:
    """Return a compiled function (*parameters, s, rows), which writes what the fields give.

    Args:
        declarations: The fields; those about a setting may stand anywhere among them.
        parameters: ``("c", "v")``, or ``("c", "v", "m")`` for fields of a team-mate. Then comes
            scratch memory.
    """
    lines, columns = [], 0
    names: dict[str, Any] = {"np": np, "eight": eight, "block": _write_block, "one": _write_column}
    for k, field in enumerate(declarations):
        names[f"field_{k}"] = field.function
        parts = [f"column_{columns + q}" for q in range(field.size)]
        given = "c" if field.subject == "setting" else ", ".join(parameters)
        lines.append(f"{', '.join(parts)} = field_{k}({given})")
        if field.subject == "setting":
            lines += [f"{part} = eight(np.float32({part}))" for part in parts]
        columns += field.size
        # As soon as there are eight, so that few have to be kept at a time.
        for first in range(_written(columns - field.size), _written(columns), WIDTH):
            lines.append(_block(first))
    rest = columns % WIDTH
    if rest > _FEW:
        lines.append(_block(columns - WIDTH))  # some of them once more
    else:
        lines += [f"one(column_{k}, {k}, s, rows)" for k in range(columns - rest, columns)]
    return written("write_rows", (*parameters, "s", "rows"), lines, names)


def _written(columns: int) -> int:
    return columns // WIDTH * WIDTH


def _block(first: int) -> str:
    columns = ", ".join(f"column_{first + q}" for q in range(WIDTH))
    return f"block({columns}, {first}, rows)"


def empty_writer(declarations: Declarations) -> Callable[..., Any]:
    """Return a compiled function (o, k), which writes an empty place of a team-mate from k on."""
    values = [float(d.unknown or 0.0) for d in declarations for _ in range(d.size)]
    lines = [f"o[k + {q}] = np.float32({value})" for q, value in enumerate(values)]
    return written("write_empty", ("o", "k"), lines, {"np": np})


@compiled
def _write_block(
    a: Lanes,
    b: Lanes,
    c: Lanes,
    d: Lanes,
    f: Lanes,
    g: Lanes,
    h: Lanes,
    j: Lanes,
    first: int,
    rows: Rows,
) -> None:
    """Write eight columns, the first of them column ``first``."""
    a, b, c, d, f, g, h, j = transpose(a, b, c, d, f, g, h, j)
    # Not in a loop: which of a tuple is meant would be looked up at run time.
    _write_row(a, 0, first, rows)
    _write_row(b, 1, first, rows)
    _write_row(c, 2, first, rows)
    _write_row(d, 3, first, rows)
    _write_row(f, 4, first, rows)
    _write_row(g, 5, first, rows)
    _write_row(h, 6, first, rows)
    _write_row(j, 7, first, rows)


@compiled
def _write_row(row: Lanes, lane: int, first: int, rows: Rows) -> None:
    """Write eight numbers of one observer, if there are so many observers."""
    if lane < rows.observers.number:
        o = rows.observations[world_of(rows.observers, lane), robot_of(rows.observers, lane)]
        store(o, _start(rows, lane) + first, row)


@compiled
def _write_column(column: Lanes, number: int, s: Any, rows: Rows) -> None:
    """Write one column."""
    store(s.column, 0, column)
    for lane in range(rows.observers.number):
        o = rows.observations[world_of(rows.observers, lane), robot_of(rows.observers, lane)]
        o[_start(rows, lane) + number] = s.column[lane]


@compiled
def world_of(observers: Observers, lane: int) -> int:
    """Return the world of the robot in a lane."""
    return natural(observers.e + lane * observers.across)


@compiled
def robot_of(observers: Observers, lane: int) -> int:
    """Return the number of the robot in a lane."""
    return natural(observers.i + lane * (1 - observers.across))


@compiled
def _start(rows: Rows, lane: int) -> int:
    scattered = natural(int(rows.starts[lane])) if rows.scattered else 0
    return natural(rows.start) + scattered
