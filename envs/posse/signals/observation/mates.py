"""Observations of team-mates, nearest first, for eight robots at once, one per lane.

With a perfect radio the current state of team-mates is observed. In a small team observed as a
whole, each mate is computed once and written to its place. With fewer places than team-mates or a
large team, the nearest are listed first (:mod:`~.nearest`) and then written place by
place. The same applies to received messages, and to the observations of a target agent.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posse.numeric import (
    WIDTH,
    FloatArray,
    Lanes,
    Record,
    choose,
    compiled,
    counts,
    eight,
    load,
    load_fields,
    root,
    store,
    transpose,
)
from posse.rules.discs import natural
from posse.rules.state import MESSAGE, POSE, WorldArrays
from posse.signals.generate import Generated
from posse.signals.observation.nearest import keep_nearest, list_nearest
from posse.signals.observation.rows import Observers, Rows, robot_of, world_of
from posse.signals.observation.team import number_behind, seen_at, stride_of, way_behind
from posse.signals.observation.views import View, ego, mate_heard, mate_now
from posse.signals.scratch import MOST_IN_TEAM

_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)


@compiled
def observe_mates(
    c: Record,
    worlds: WorldArrays,
    observers: Observers,
    v: View,
    made: Generated,
    s: Record,
    observations: FloatArray,
    k: int,
) -> None:
    """Write the nearest team-mates of trackers from k on.

    With a perfect radio, requires the team's rows (:func:`~.team.lay_out_team`).
    """
    mates, places = natural(c.num_trackers - 1), natural(c.neighbours)
    if places == 0:
        return
    if c.perfect_radio == 0:
        _observe_heard(c, worlds, observers, v, made, s, observations, k)
        return
    if mates <= places and mates < MOST_IN_TEAM:
        _observe_whole_team(c, observers, v, made, s, observations, k)
    else:
        most = min(mates, places)
        list_nearest(mates + 1, most, observers.i, observers.number, observers.across, s)
        _observe_listed(c, worlds, observers, False, most, v, made, s, observations, k)
    if c.message_size > 0 or mates < places:
        for lane in range(observers.number):
            to, who = world_of(observers, lane), robot_of(observers, lane)
            _write_the_rest(c, mates, worlds.message[to, 0], made, observations[to, who], k)


@compiled
def _observe_whole_team(
    c: Record, observers: Observers, v: View, made: Generated, s: Record, observations: FloatArray, k: int
) -> None:
    """Write every team-mate."""
    n, size = natural(c.num_trackers), np.float32(made.mate_width + c.message_size)
    _, i, _, across = observers
    rows = Rows(observers, observations, k, s.start, True)
    _find_places(n, i, across, s)
    for m in range(n - 1):
        at = natural(stride_of(across) * (i + m + 1))
        dx, dy = way_behind(i, m, across, s)
        ahead, left = seen_at(i, m, across, s)
        mate = mate_now(
            number_behind(n, i, m, across, s),
            dx,
            dy,
            load(s.distance, WIDTH * m),
            ahead,
            left,
            load(s.team_cos, at),
            load(s.team_sin, at),
            load(s.team_speed, at),
            load(s.team_turn_rate, at),
        )
        store(s.start, 0, load(s.place, WIDTH * m) * size)
        made.write_mate(c, v, mate, rows)


@compiled
def _find_places(n: int, i: int, across: int, s: Record) -> None:
    """Write the rank by distance of each team-mate, m + 1 places behind its observers.

    Ties are broken by number.
    """
    for m in range(n - 1):
        ahead, left = seen_at(i, m, across, s)
        distance = root(ahead * ahead + left * left)
        number, place = number_behind(n, i, m, across, s), eight(_ZERO)
        for q in range(m):
            other, whose = load(s.distance, WIDTH * q), number_behind(n, i, q, across, s)
            nearer = (other < distance) | ((other == distance) & (whose < number))
            place = place + choose(nearer, _ONE, _ZERO)
            store(s.place, WIDTH * q, load(s.place, WIDTH * q) + choose(nearer, _ZERO, _ONE))
        store(s.distance, WIDTH * m, distance)
        store(s.place, WIDTH * m, place)


@compiled
def _observe_listed(
    c: Record,
    worlds: WorldArrays,
    observers: Observers,
    heard: bool,
    most: int,
    v: View,
    made: Generated,
    s: Record,
    observations: FloatArray,
    k: int,
) -> None:
    """Write ``most`` team-mates of each list: current or as received."""
    size = natural(made.mate_width + c.message_size)
    for place in range(natural(most)):
        x, y, cosine, sine, speed, turn_rate, step, _ = transpose(
            _pose(worlds, heard, place, 0, observers, s),
            _pose(worlds, heard, place, 1, observers, s),
            _pose(worlds, heard, place, 2, observers, s),
            _pose(worlds, heard, place, 3, observers, s),
            _pose(worlds, heard, place, 4, observers, s),
            _pose(worlds, heard, place, 5, observers, s),
            _pose(worlds, heard, place, 6, observers, s),
            _pose(worlds, heard, place, 7, observers, s),
        )
        number, dx, dy = load(s.listed, WIDTH * place), x - v.x, y - v.y
        if heard:
            age = (v.step - counts(step)) * c.dt
            mate = mate_heard(v, number, age, dx, dy, cosine, sine, speed, turn_rate)
        else:
            ahead, left = ego(v, dx, dy)
            distance = root(ahead * ahead + left * left)
            mate = mate_now(number, dx, dy, distance, ahead, left, cosine, sine, speed, turn_rate)
        rows = Rows(observers, observations, natural(k + place * size), s.start, False)
        made.write_mate(c, v, mate, rows)


@compiled
def _pose(worlds: WorldArrays, heard: bool, place: int, lane: int, observers: Observers, s: Record) -> Lanes:
    """Return the pose, and the fields after it, of a lane's listed mate.

    Lanes beyond ``count`` repeat the last one.
    """
    there = min(lane, observers.number - 1)
    number = natural(int(s.listed[WIDTH * place + there]))
    to, who = world_of(observers, there), robot_of(observers, there)
    if heard:
        return load_fields(worlds.heard[to, who, number], MESSAGE)
    return load_fields(worlds.tracker[to, number], POSE)


@compiled
def _observe_heard(
    c: Record,
    worlds: WorldArrays,
    observers: Observers,
    v: View,
    made: Generated,
    s: Record,
    observations: FloatArray,
    k: int,
) -> None:
    """Write the nearest team-mates and their messages, as last received."""
    most = 0
    for lane in range(observers.number):
        to, who = world_of(observers, lane), robot_of(observers, lane)
        filled = _list_heard(c, worlds, to, who, lane, s)
        s.filled[lane] = np.float32(filled)
        most = max(most, filled)
    _observe_listed(c, worlds, observers, True, most, v, made, s, observations, k)
    for lane in range(observers.number):
        to, who = world_of(observers, lane), robot_of(observers, lane)
        filled, o = natural(int(s.filled[lane])), observations[to, who]
        if c.message_size > 0 or filled < c.neighbours:
            _write_the_rest(c, filled, worlds.heard_message[to, who], made, o, k)


@compiled
def _list_heard(c: Record, worlds: WorldArrays, e: int, i: int, lane: int, s: Record) -> int:
    """List the team-mates heard by tracker i of world e, nearest first; return their number."""
    t, step, filled = worlds.tracker[e, i], worlds.world[e].step, 0
    for j in range(natural(c.num_trackers)):
        h = worlds.heard[e, i, j]
        if j != i and h.step >= 0 and step - h.step <= c.forget_steps:
            dx, dy = h.x - t.x, h.y - t.y
            filled = keep_nearest(c.neighbours, filled, j, dx * dx + dy * dy, s)
    for place in range(natural(c.neighbours)):
        s.listed[WIDTH * place + lane] = s.who[place] if place < filled else _ZERO
    return filled


@compiled
def observe_trackers(
    c: Record, worlds: WorldArrays, e: int, v: View, made: Generated, s: Record, observations: FloatArray, k: int
) -> None:
    """Write the nearest trackers of a target agent, without messages, from k on."""
    w, n, filled = worlds.world[e], natural(c.num_trackers), 0
    for j in range(n):
        t = worlds.tracker[e, j]
        dx, dy = t.x - w.x, t.y - w.y
        if c.neighbours > 0:
            filled = keep_nearest(c.neighbours, filled, j, dx * dx + dy * dy, s)
    size, o = natural(made.mate_width + c.message_size), observations[e, n]
    for place in range(natural(c.neighbours)):
        start = natural(k + place * size)
        if place < filled:
            number = natural(int(s.who[place]))
            t = worlds.tracker[e, number]
            mate = mate_heard(
                v,
                eight(np.float32(number)),
                eight(_ZERO),
                t.x - v.x,
                t.y - v.y,
                eight(t.heading_cos),
                eight(t.heading_sin),
                eight(t.speed),
                eight(t.turn_rate),
            )
            rows = Rows(Observers(e, n, 1, 0), observations, start, s.start, False)
            made.write_mate(c, v, mate, rows)
        else:
            made.write_empty(o, start)
        for q in range(c.message_size):
            o[start + made.mate_width + q] = _ZERO


@compiled(seldom=True)
def _write_the_rest(c: Record, filled: int, said: FloatArray, made: Generated, o: FloatArray, k: int) -> None:
    """Write the messages (N, m) of the first ``filled`` team-mates, and the empty places."""
    size = natural(made.mate_width + c.message_size)
    for place in range(natural(c.neighbours)):
        start = natural(k + place * size)
        message = start + made.mate_width
        if place < filled:
            number = natural(int(o[start]))  # the first field of a team-mate
            for q in range(c.message_size):
                o[message + q] = said[number, q]
        else:
            made.write_empty(o, start)
            for q in range(c.message_size):
                o[message + q] = _ZERO
