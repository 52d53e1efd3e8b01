"""Observations of team-mates, nearest first, for the same robot of eight worlds, one per lane.

The nearest that each observer knows are listed, place by place; then the mate of each place is
written for all lanes at once. With a perfect radio, and for a target agent, mates are as they are
now, otherwise as last heard.
"""

from __future__ import annotations

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
    bits,
    choose,
    compiled,
    counts,
    eight,
    greater,
    lesser,
    load,
    load_fields,
    root,
    store,
    transpose,
)
from posse.rules.discs import FAR, nonnegative
from posse.rules.state import MESSAGE, POSE, Heard, Pose, WorldArrays
from posse.signals.generate import Generated
from posse.signals.views import Mate, Observers, Rows, View, columns, ego, world_of


@compiled
def observe_mates(
    c: Record,
    worlds: WorldArrays,
    observers: Observers,
    v: View,
    now: bool,
    made: Generated,
    s: Record,
    observations: FloatArray,
) -> None:
    """Write the nearest team-mates, as they are ``now`` or as last heard.

    Requires :func:`~.views.lay_out_observers`.
    """
    places = nonnegative(c.neighbours)
    if places == 0:
        return
    _list_nearest(c, worlds, observers, v, now, s)
    start, size = nonnegative(made.width + c.sonar_beams), nonnegative(made.mate_width + c.message_size)
    for p in range(places):
        number = load(s.placed, WIDTH * p)
        if bits(number >= ZERO) == 0:
            break
        mate = _mate_in_place(c, worlds, observers, v, p, now, s)
        made.write_mate(c, v, mate, s, Rows(observers, observations, nonnegative(start + p * size)))
    if c.message_size > 0 or bits(load(s.placed, WIDTH * (places - 1)) < ZERO) != 0:
        _write_the_rest(c, worlds, observers, made, s, observations)


@compiled
def _list_nearest(c: Record, worlds: WorldArrays, observers: Observers, v: View, now: bool, s: Record) -> None:
    """List the nearest mates that the observers know; of equally near ones the lower number is first."""
    n, places = nonnegative(c.num_trackers), nonnegative(c.neighbours)
    for p in range(places):
        store(s.placed, WIDTH * p, eight(-ONE))
        store(s.placed_at, WIDTH * p, eight(FAR))
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
    heard = Heard(*columns(worlds.heard[:, nonnegative(observers.i)], observers, j, MESSAGE))
    sent = counts(heard.step)
    return heard.x, heard.y, (sent >= ZERO) & (v.step - sent <= np.float32(c.forget_steps))


@compiled
def _mate_in_place(c: Record, worlds: WorldArrays, observers: Observers, v: View, p: int, now: bool, s: Record) -> Mate:
    """Return the mate in a place of each observer; of one without, the first tracker."""
    fields = transpose(
        _fields_of(worlds, observers, p, now, 0, s),
        _fields_of(worlds, observers, p, now, 1, s),
        _fields_of(worlds, observers, p, now, 2, s),
        _fields_of(worlds, observers, p, now, 3, s),
        _fields_of(worlds, observers, p, now, 4, s),
        _fields_of(worlds, observers, p, now, 5, s),
        _fields_of(worlds, observers, p, now, 6, s),
        _fields_of(worlds, observers, p, now, 7, s),
    )
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


@compiled(out_of_line=True)
def _write_the_rest(
    c: Record, worlds: WorldArrays, observers: Observers, made: Generated, s: Record, observations: FloatArray
) -> None:
    """Write the messages of the listed mates, none to a target, and the empty places."""
    size = nonnegative(made.mate_width + c.message_size)
    for lane in range(observers.number):
        e, i = nonnegative(observers.e + lane), nonnegative(observers.i)
        o = observations[e, i]
        for p in range(nonnegative(c.neighbours)):
            start, number = nonnegative(made.width + c.sonar_beams + p * size), int(s.placed[WIDTH * p + lane])
            if number < 0:
                made.write_empty(o, start)
            for q in range(nonnegative(c.message_size)):
                said = ZERO
                if number >= 0 and i < c.num_trackers:
                    j = nonnegative(number)
                    said = worlds.message[e, 0, j, q] if c.perfect_radio != 0 else worlds.heard_message[e, i, j, q]
                o[start + made.mate_width + q] = said
