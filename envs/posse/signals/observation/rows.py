"""Columns of eight observers are transposed and written to the rows of the observations.

The eight are the same robot of eight worlds. With fewer worlds the last one is repeated, and
written once. A column is one number of a field (:mod:`posse.signals.generate`).
"""

from __future__ import annotations

from typing import NamedTuple

from posse.numeric import FloatArray, Lanes, Record, compiled, store, transpose
from posse.rules.discs import natural


class Observers(NamedTuple):
    """Robot i of ``number`` worlds, at most eight, from world e on."""

    e: int
    i: int
    number: int


@compiled
def world_of(observers: Observers, lane: int) -> int:
    """Return the world of a lane."""
    return natural(observers.e + min(lane, observers.number - 1))


class Rows(NamedTuple):
    """Where to write in the observations of eight robots."""

    observers: Observers
    observations: FloatArray
    """(E, rows, F)."""
    start: int
    """Place in an observation that the first column goes to."""


@compiled
def write_block(
    a: Lanes, b: Lanes, c: Lanes, d: Lanes, f: Lanes, g: Lanes, h: Lanes, j: Lanes, first: int, rows: Rows
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
def write_column(column: Lanes, number: int, s: Record, rows: Rows) -> None:
    """Write one column."""
    store(s.column, 0, column)
    for lane in range(rows.observers.number):
        o = rows.observations[natural(rows.observers.e + lane), natural(rows.observers.i)]
        o[natural(rows.start) + number] = s.column[lane]


@compiled
def _write_row(row: Lanes, lane: int, first: int, rows: Rows) -> None:
    if lane < rows.observers.number:
        o = rows.observations[natural(rows.observers.e + lane), natural(rows.observers.i)]
        store(o, natural(rows.start) + first, row)
