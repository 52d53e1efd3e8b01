"""Writes the rows of the observations, for one robot of eight worlds at once, one world per lane.

The generated functions (:mod:`posse.signals.generate`) compute the fields of a view
(:mod:`.views`); each gives a *column* of eight numbers, one for each world, which are transposed
and written to the worlds' rows.
"""

from __future__ import annotations

from typing import Final

from posse.numeric import WIDTH, FloatArray, Lanes, Record, Records, compiled, store, transpose
from posse.rules.discs import nonnegative
from posse.rules.senses.sonar import ping
from posse.rules.state import WorldArrays
from posse.signals.generate import Generated
from posse.signals.mates import observe_mates
from posse.signals.views import Observers, Rows, lay_out_observers, view_of_targets, view_of_trackers

TOGETHER: Final = WIDTH
"""Worlds processed together."""


@compiled
def observe_together(
    c: Record, worlds: WorldArrays, first: int, count: int, made: Generated, s: Record, observations: FloatArray
) -> None:
    """Write the observations of all agents of ``count`` worlds, at most eight, without the sonar."""
    lay_out_observers(c, worlds, first, count, s)
    for i in range(nonnegative(c.num_trackers)):
        observers = Observers(first, i, count)
        view = view_of_trackers(c, worlds, observers, s)
        made.write_own(c, view, s, Rows(observers, observations, 0))
        observe_mates(c, worlds, observers, view, c.perfect_radio != 0, made, s, observations)
    if c.target_agent != 0:
        _observe_targets(c, worlds, Observers(first, c.num_trackers, count), made, s, observations)


@compiled(out_of_line=True)
def _observe_targets(
    c: Record, worlds: WorldArrays, observers: Observers, made: Generated, s: Record, observations: FloatArray
) -> None:
    """Write what target agents observe: the trackers in the places of team-mates, without error."""
    view = view_of_targets(c, s)
    made.write_own(c, view, s, Rows(observers, observations, 0))
    observe_mates(c, worlds, observers, view, True, made, s, observations)


@compiled
def observe_sonar(c: Record, w: Record, trackers: Records, s: Record, observations: FloatArray, first: int) -> None:
    """Write the sonar of every agent of a world to (rows, F), from ``first`` on.

    Positions of discs are read from ``s`` (:func:`posse.rules.discs.lay_out`).
    """
    n = nonnegative(c.num_trackers)
    for i in range(n):
        t = trackers[i]
        pose = (t.x, t.y, t.heading_cos, t.heading_sin)
        ping(c, pose, i, s, observations[i], first)
    if c.target_agent != 0:
        ping(c, (w.x, w.y, w.heading_cos, w.heading_sin), n, s, observations[n], first)


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
    if lane < rows.observers.number:
        o = rows.observations[nonnegative(rows.observers.e + lane), nonnegative(rows.observers.i)]
        store(o, nonnegative(rows.start) + first, row)


@compiled
def write_column(column: Lanes, number: int, s: Record, rows: Rows) -> None:
    """Write one column."""
    store(s.column, 0, column)
    for lane in range(rows.observers.number):
        o = rows.observations[nonnegative(rows.observers.e + lane), nonnegative(rows.observers.i)]
        o[nonnegative(rows.start) + number] = s.column[lane]
