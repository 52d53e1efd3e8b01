"""Columns of eight observers are transposed and written to the rows of the observations.

A column is one number of a field for eight observers (:mod:`posse.signals.generate`).
"""

from __future__ import annotations

from typing import NamedTuple

from posse.numeric import FloatArray, Lanes, compiled, store, transpose
from posse.rules.discs import natural


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
def _write_row(row: Lanes, lane: int, first: int, rows: Rows) -> None:
    """Write eight numbers of one observer, if there are so many observers."""
    if lane < rows.observers.number:
        o = rows.observations[world_of(rows.observers, lane), robot_of(rows.observers, lane)]
        scattered = natural(int(rows.starts[lane])) if rows.scattered else 0
        store(o, natural(rows.start) + scattered + first, row)


@compiled
def world_of(observers: Observers, lane: int) -> int:
    """Return the world of the robot in a lane."""
    return natural(observers.e + lane * observers.across)


@compiled
def robot_of(observers: Observers, lane: int) -> int:
    """Return the number of the robot in a lane."""
    return natural(observers.i + lane * (1 - observers.across))
