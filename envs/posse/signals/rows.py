"""Writes the observations, for one robot of eight worlds at once, one world per lane.

The generated functions (:mod:`posse.signals.generate`) compute the fields of a view (:mod:`.views`). Each gives a
*column* of eight numbers, one for each world; eight columns are transposed and
written to the worlds' rows, those left over one by one.

Team-mates follow, nearest first. With a perfect radio, and for a target agent, they are as they are now, otherwise as
last heard.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posse.numeric import (
    ONE,
    TINY,
    WIDTH,
    ZERO,
    FloatArray,
    Lanes,
    Mask,
    Record,
    Records,
    bits,
    choose,
    compiled,
    counts,
    eight,
    greater,
    lesser,
    load,
    load_fields,
    out_of_line,
    root,
    store,
    transpose,
)
from posse.rules.discs import FAR, nonnegative
from posse.rules.senses.sonar import ping
from posse.rules.state import MESSAGE, POSE, Heard, Pose, WorldArrays
from posse.signals.generate import Generated
from posse.signals.views import Mate, Observers, Rows, View, ego, lay_out_observers, of_worlds, view_of, world_of

TOGETHER: Final = WIDTH
"""Worlds processed together."""


@compiled
def observe_together(
    c: Record, worlds: WorldArrays, first: int, count: int, made: Generated, s: Record, observations: FloatArray
) -> None:
    """Write the observations of all agents of ``count`` worlds, at most eight, without the sonar."""
    n = nonnegative(c.num_trackers)
    lay_out_observers(c, worlds, first, count, s)
    for i in range(n + 1 if c.target_agent != 0 else n):
        observers = Observers(first, i, count)
        view = view_of(c, worlds, observers, s)
        made.write_own(c, view, s, Rows(observers, observations, 0))
        now = c.perfect_radio != 0 or i == n
        _list_nearest(c, worlds, observers, view, now, s)
        start, size = nonnegative(made.width + c.sonar_beams), nonnegative(made.mate_width + c.message_size)
        for p in range(nonnegative(c.neighbours)):
            mate = _mate_in_place(c, worlds, observers, view, p, now, s)
            made.write_mate(c, view, mate, s, Rows(observers, observations, nonnegative(start + p * size)))
        if c.message_size > 0:
            _write_messages(c, worlds, observers, made, s, observations)


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
def _list_nearest(c: Record, worlds: WorldArrays, observers: Observers, v: View, now: bool, s: Record) -> None:
    """List the nearest mates that the observers know; of equally near ones the lower number is first."""
    n, places = nonnegative(c.num_trackers), nonnegative(c.neighbours)
    for p in range(places):
        store(s.placed, WIDTH * p, eight(-ONE))
        store(s.placed_at, WIDTH * p, eight(FAR))
    if places == 0:
        return
    for j in range(n - 1, -1, -1):  # so that a mate comes before equally near ones in the list
        if j == observers.i:
            continue
        if now:
            x, y, known = load(s.team_x, WIDTH * j), load(s.team_y, WIDTH * j), v.step >= ZERO
        else:
            x, y, known = _heard(c, worlds, observers, v, j)
        ahead, left = ego(v, x - v.x, y - v.y)
        number = choose(known, np.float32(j), -ONE)
        distance = choose(known, root(ahead * ahead + left * left), FAR)
        if bits(distance <= load(s.placed_at, WIDTH * (places - 1))) == 0:
            continue
        for p in range(min(n - j, places)):
            other, whose = load(s.placed_at, WIDTH * p), load(s.placed, WIDTH * p)
            nearer = distance <= other
            store(s.placed, WIDTH * p, choose(nearer, number, whose))
            store(s.placed_at, WIDTH * p, lesser(other, distance))
            number, distance = choose(nearer, whose, number), greater(other, distance)


@compiled
def _heard(c: Record, worlds: WorldArrays, observers: Observers, v: View, j: int) -> tuple[Lanes, Lanes, Mask]:
    """Return where mate j was when last heard, and whether that is not forgotten."""
    heard = Heard(*of_worlds(worlds.heard[:, nonnegative(observers.i), nonnegative(j)], observers, MESSAGE))
    sent = counts(heard.step)
    return heard.x, heard.y, (sent >= ZERO) & (v.step - sent <= np.float32(c.forget_steps))


@compiled
def _mate_in_place(c: Record, worlds: WorldArrays, observers: Observers, v: View, p: int, now: bool, s: Record) -> Mate:
    """Return the mate in a place of each observer; in an empty place, number -1 and the data of the first tracker."""
    rows = (
        _fields_of(worlds, observers, p, now, 0, s),
        _fields_of(worlds, observers, p, now, 1, s),
        _fields_of(worlds, observers, p, now, 2, s),
        _fields_of(worlds, observers, p, now, 3, s),
        _fields_of(worlds, observers, p, now, 4, s),
        _fields_of(worlds, observers, p, now, 5, s),
        _fields_of(worlds, observers, p, now, 6, s),
        _fields_of(worlds, observers, p, now, 7, s),
    )
    fields = transpose(rows)
    if now:
        t, age = Pose(*fields), eight(ZERO)
        x, y, cos, sin, speed, turn_rate = t.x, t.y, t.heading_cos, t.heading_sin, t.speed, t.turn_rate
    else:
        h = Heard(*fields)
        x, y, cos, sin, speed, turn_rate = h.x, h.y, h.heading_cos, h.heading_sin, h.speed, h.turn_rate
        age = (v.step - counts(h.step)) * c.control_step
    distance, dx, dy = load(s.placed_at, WIDTH * p), x - v.x, y - v.y
    ahead, left = ego(v, dx, dy)
    apart, per_metre = distance > ZERO, ONE / greater(distance, TINY)
    return Mate(
        number=load(s.placed, WIDTH * p),
        age=age,
        dx=dx,
        dy=dy,
        distance=distance,
        ahead=choose(apart, ahead * per_metre, ONE),
        left=choose(apart, left * per_metre, ZERO),
        heading_cos=cos,
        heading_sin=sin,
        speed=speed,
        turn_rate=turn_rate,
    )


@compiled
def _fields_of(worlds: WorldArrays, observers: Observers, p: int, now: bool, lane: int, s: Record) -> Lanes:
    """Return eight fields of a lane's mate in a place: now, or as last heard."""
    e, j = world_of(observers, lane), nonnegative(max(int(s.placed[WIDTH * p + lane]), 0))
    if now:
        return load_fields(worlds.tracker[e, j], POSE)
    return load_fields(worlds.heard[e, nonnegative(observers.i), j], MESSAGE)


@out_of_line
def _write_messages(
    c: Record, worlds: WorldArrays, observers: Observers, made: Generated, s: Record, observations: FloatArray
) -> None:
    """Write the messages of the listed mates: none in an empty place, and none to a target."""
    size, i = nonnegative(made.mate_width + c.message_size), nonnegative(observers.i)
    for lane in range(observers.number):
        e = nonnegative(observers.e + lane)
        for p in range(nonnegative(c.neighbours)):
            number = int(s.placed[WIDTH * p + lane])
            start = nonnegative(made.width + c.sonar_beams + p * size + made.mate_width)
            for q in range(nonnegative(c.message_size)):
                said = ZERO
                if number >= 0 and i < c.num_trackers:
                    j = nonnegative(number)
                    said = worlds.message[e, 0, j, q] if c.perfect_radio != 0 else worlds.heard_message[e, i, j, q]
                observations[e, i, start + q] = said


@compiled
def write_block(columns: tuple[Lanes, ...], first: int, rows: Rows) -> None:
    """Write eight columns, the first of them column ``first``."""
    a, b, c, d, f, g, h, j = transpose(columns)
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
