"""What trackers observe of their team-mates where the radio is perfect: eight at once, a lane each.

Of a small team that is observed as a whole, each team-mate is worked out once and written to its
place. Where there are fewer places than team-mates, or the team is large, the nearest are listed
first (:mod:`posse.signals.nearest`), and then the nearest of all eight are written together, after
them the second nearest, and so on.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posse.numeric import (
    WIDTH,
    FloatArray,
    Lanes,
    Record,
    Records,
    choose,
    compiled,
    eight,
    greater,
    load,
    load_fields,
    root,
    store,
    transpose,
)
from posse.rules.discs import natural, within_one
from posse.rules.state import POSE
from posse.signals.nearest import list_nearest
from posse.signals.scratch import MOST_IN_TEAM
from posse.signals.team import number_behind, seen_at, stride_of, write_rows

MATE: Final = 9
"""Numbers that are observed of a team-mate, what it said apart."""

_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)
_MINUS_ONE: Final = np.float32(-1.0)
_TINY: Final = np.float32(1e-9)


@compiled
def observe_mates(
    c: Record,
    tracker: Records,
    e: int,
    i: int,
    count: int,
    across: int,
    message: FloatArray,
    s: Record,
    observations: FloatArray,
    k: int,
) -> None:
    """Write the nearest team-mates of observers from k on, the nearest first.

    They are ``count`` trackers, the first of them i of world e, whose team stands in its rows
    (:func:`posse.signals.team.lay_out_team`).
    """
    mates, places = natural(c.num_trackers - 1), natural(c.neighbours)
    if mates <= places and mates < MOST_IN_TEAM:
        _observe_whole_team(c, e, i, count, across, s, observations, k)
    elif places > 0:
        _observe_nearest(c, tracker, e, i, count, across, s, observations, k)
    if c.message_size > 0 or mates < places:
        for lane in range(count):
            to = natural(e + lane * across)
            o = observations[to, natural(i + lane * (1 - across))]
            _write_the_rest(c, message[to, 0], o, k)


@compiled(seldom=True)
def _write_the_rest(c: Record, said: FloatArray, o: FloatArray, k: int) -> None:
    """Write what team-mates said, of (N, m), to their places, and that others are empty."""
    for place in range(c.neighbours):
        start = natural(k + place * (MATE + c.message_size))
        if place < c.num_trackers - 1:
            number = min(natural(int(o[start])), natural(c.num_trackers - 1))
            copy_message(c, said[number], o, start)
        else:
            leave_empty(c, o, start)


@compiled
def _find_places(n: int, i: int, across: int, s: Record) -> None:
    """Write how far each team-mate is from its observers, and how many are nearer.

    Or as near, and of a lower number.
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
def _observe_whole_team(
    c: Record,
    e: int,
    i: int,
    count: int,
    across: int,
    s: Record,
    observations: FloatArray,
    k: int,
) -> None:
    """Write every team-mate of observers from k on: each has a place."""
    n, size = natural(c.num_trackers), np.float32(MATE + c.message_size)
    stride = stride_of(across)
    own = natural(stride * i)
    _find_places(n, i, across, s)
    for m in range(n - 1):
        at = own + natural(stride * (m + 1))
        ahead, left = seen_at(i, m, across, s)
        mates = _describe_mates(
            load(s.team_cos, own), load(s.team_sin, own), number_behind(n, i, m, across, s),
            ahead, left, load(s.distance, WIDTH * m),
            load(s.team_cos, at), load(s.team_sin, at), load(s.team_speed, at),
        )  # fmt: skip
        store(s.turn_rates, 0, load(s.team_turn_rate, at))
        store(s.start, 0, load(s.place, WIDTH * m) * size + np.float32(k))
        _write_mates(mates, e, i, count, across, s, observations)


@compiled
def _observe_nearest(
    c: Record,
    tracker: Records,
    e: int,
    i: int,
    count: int,
    across: int,
    s: Record,
    observations: FloatArray,
    k: int,
) -> None:
    """Write the nearest team-mates of observers from k on, as many as there are places."""
    n, size = natural(c.num_trackers), natural(MATE + c.message_size)
    places = min(n - 1, natural(c.neighbours))
    own = natural(stride_of(across) * i)
    list_nearest(n, places, i, count, across, s)
    for place in range(natural(places)):
        listed = WIDTH * place
        # Not kept from place to place: to load them again costs less than registers do.
        own_x, own_y = load(s.team_x, own), load(s.team_y, own)
        hc, hs = load(s.team_cos, own), load(s.team_sin, own)
        x, y, heading_x, heading_y, speed, turn_rate, _, _ = _columns_of(
            tracker, listed, e, count, across, s
        )
        dx, dy = x - own_x, y - own_y
        ahead, left = dx * hc + dy * hs, dy * hc - dx * hs
        mates = _describe_mates(
            hc, hs, load(s.listed, listed), ahead, left, root(ahead * ahead + left * left),
            heading_x, heading_y, speed,
        )  # fmt: skip
        store(s.turn_rates, 0, turn_rate)
        at = natural(k + place * size)
        write_rows(mates, e, i, count, across, observations, at)
        for lane in range(count):
            o = observations[natural(e + lane * across), natural(i + lane * (1 - across))]
            o[at + MATE - 1] = s.turn_rates[lane]


@compiled
def _describe_mates(
    hc: Lanes,
    hs: Lanes,
    numbers: Lanes,
    ahead: Lanes,
    left: Lanes,
    metres: Lanes,
    heading_x: Lanes,
    heading_y: Lanes,
    speed: Lanes,
) -> tuple[Lanes, ...]:
    """Return what robots observe of eight team-mates, of each as it stands in an observation.

    Number, age (0), range, bearing and heading (cosine and sine, ego), speed. From how the robots
    head, who the team-mates are, where they are as the robots see it, and their headings in the
    common frame.
    """
    per_metre = _ONE / greater(metres, _TINY)
    return transpose(
        numbers, eight(_ZERO), metres,
        within_one(ahead * per_metre), within_one(left * per_metre),
        within_one(heading_x * hc + heading_y * hs), within_one(heading_y * hc - heading_x * hs),
        speed,
    )  # fmt: skip


@compiled
def _columns_of(
    tracker: Records, listed: int, e: int, count: int, across: int, s: Record
) -> tuple[Lanes, ...]:
    """Return :func:`posse.signals.team.team_columns` of the poses of those that are listed."""
    return transpose(
        _pose(tracker, listed, 0, e, count, across, s),
        _pose(tracker, listed, 1, e, count, across, s),
        _pose(tracker, listed, 2, e, count, across, s),
        _pose(tracker, listed, 3, e, count, across, s),
        _pose(tracker, listed, 4, e, count, across, s),
        _pose(tracker, listed, 5, e, count, across, s),
        _pose(tracker, listed, 6, e, count, across, s),
        _pose(tracker, listed, 7, e, count, across, s),
    )


@compiled
def _pose(
    tracker: Records, listed: int, lane: int, e: int, count: int, across: int, s: Record
) -> Lanes:
    """Return the pose of whom a lane's list names, and what follows on it.

    The last of ``count`` lanes stands in for those that there are not.
    """
    number = natural(int(s.listed[listed + min(lane, count - 1)]))
    return load_fields(tracker[natural(e + lane * across), number], POSE)


@compiled
def _write_mates(
    mates: tuple[Lanes, ...],
    e: int,
    i: int,
    count: int,
    across: int,
    s: Record,
    observations: FloatArray,
) -> None:
    """Write what each of ``count`` observers observes of one team-mate, from where _START says."""
    first, second, third, fourth, fifth, sixth, seventh, eighth = mates
    _write_mate(first, 0, e, i, count, across, s, observations)
    _write_mate(second, 1, e, i, count, across, s, observations)
    _write_mate(third, 2, e, i, count, across, s, observations)
    _write_mate(fourth, 3, e, i, count, across, s, observations)
    _write_mate(fifth, 4, e, i, count, across, s, observations)
    _write_mate(sixth, 5, e, i, count, across, s, observations)
    _write_mate(seventh, 6, e, i, count, across, s, observations)
    _write_mate(eighth, 7, e, i, count, across, s, observations)


@compiled
def _write_mate(
    fields: Lanes,
    lane: int,
    e: int,
    i: int,
    count: int,
    across: int,
    s: Record,
    observations: FloatArray,
) -> None:
    """Write what one of ``count`` observers observes of a team-mate, if there are so many."""
    if lane >= count:
        return
    o = observations[natural(e + lane * across), natural(i + lane * (1 - across))]
    start = natural(int(s.start[lane]))
    store(o, start, fields)
    o[start + MATE - 1] = s.turn_rates[lane]


@compiled
def copy_message(c: Record, said: FloatArray, o: FloatArray, k: int) -> None:
    """Write what a team-mate said, (m,), into its place, which begins at k."""
    for q in range(c.message_size):
        o[k + MATE + q] = said[q]


@compiled
def leave_empty(c: Record, o: FloatArray, k: int) -> None:
    """Write a place that no team-mate fills, from k on."""
    for q in range(k + 3, k + MATE + c.message_size):
        o[q] = _ZERO
    o[k] = _MINUS_ONE
    o[k + 1] = _MINUS_ONE
    o[k + 2] = _MINUS_ONE
