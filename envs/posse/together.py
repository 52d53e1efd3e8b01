"""What trackers observe of themselves, their target and a whole team: eight at once, a lane each.

The eight are one tracker of eight worlds (``across`` is 1) or, where there are fewer worlds, the
trackers of one (0). Rows of scratch memory hold a team twice, one after the other, so that a
team-mate lies as many places behind its observer, whoever that is.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posse.arrays import FloatArray, Record, Records
from posse.compiled import compiled
from posse.lanes import (
    WIDTH,
    Lanes,
    choose,
    eight,
    greater,
    load,
    load_fields,
    root,
    store,
    transpose,
)
from posse.state import FIX, NEVER, POSE
from posse.survey import (
    INDEX,
    MOST_IN_TEAM,
    OWN,
    ROW,
    TASK,
    TEAM,
    columns,
    describe_mates,
    natural,
    within_one,
)

TOGETHER: Final = WIDTH
"""Worlds that are observed together."""

# Where in an observation its parts begin: own motion at 0, then the task, the target, the sonar,
# and team-mates.
TASK_AT: Final = 8
TARGET_AT: Final = TASK_AT + 18
SONAR_AT: Final = TARGET_AT + 12

# Scratch memory, of the eight observers: which step it is, when the fix was, whether it sees the
# target, touches anything, and works; where in the observation a team-mate belongs. Of every
# team-mate: how far it is, and how many are nearer.
_STEP: Final = OWN
_FIXED_AT: Final = OWN + 1 * WIDTH
_SEES: Final = OWN + 2 * WIDTH
_TOUCHING: Final = OWN + 3 * WIDTH
_WORKING: Final = OWN + 4 * WIDTH
_START: Final = OWN + 5 * WIDTH
_DISTANCE: Final = OWN + 1 * ROW
_PLACE: Final = OWN + 2 * ROW

_NUMBER_AT: Final = np.float32(3)  # in the task's part: which tracker it is
_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)
_MINUS_ONE: Final = np.float32(-1.0)
_TINY: Final = np.float32(1e-9)


@compiled
def _stride(across: int) -> int:
    """Return how far one tracker lies from the next in a row of the team."""
    return WIDTH if across else 1


@compiled
def _row(n: int, across: int) -> int:
    """Return how far one row of the team lies from the next.

    The last block of a row may run over the end of what it holds.
    """
    return natural(2 * n * _stride(across) + WIDTH)


@compiled
def _columns(tracker: Records, e: int, i: int, across: int, offset: int) -> tuple[Lanes, ...]:
    """Return :func:`posse.survey.columns` of eight trackers, of (E, N), from world e's i on."""
    if across:
        return transpose(
            load_fields(tracker[e, i], offset),
            load_fields(tracker[e + 1, i], offset),
            load_fields(tracker[e + 2, i], offset),
            load_fields(tracker[e + 3, i], offset),
            load_fields(tracker[e + 4, i], offset),
            load_fields(tracker[e + 5, i], offset),
            load_fields(tracker[e + 6, i], offset),
            load_fields(tracker[e + 7, i], offset),
        )
    return columns(tracker[e], i, tracker.shape[1], offset)


@compiled
def whole_team(c: Record) -> bool:
    """Say whether a tracker observes its whole team, where it is now, and that is written here."""
    return bool(
        c.perfect_radio != 0
        and c.num_trackers <= MOST_IN_TEAM
        and c.num_trackers == c.neighbours + 1
    )


@compiled
def lay_out_team(tracker: Records, e: int, across: int, s: FloatArray) -> None:
    """Write the rows of the team of world e, or of eight worlds.

    They hold x, y, heading (cosine, sine), speed and turn rate.
    """
    n = natural(tracker.shape[1])
    stride, row = _stride(across), _row(n, across)
    each = WIDTH // stride
    # From the last block on: what fills it is overwritten by the others' second place.
    for block in range((n + each - 1) // each - 1, -1, -1):
        i = natural(each * block)
        x, y, cosine, sine, speed, turn_rate, _, _ = _columns(tracker, e, i, across, POSE)
        for at in (TEAM + stride * i, TEAM + natural(stride * (i + n))):
            store(s, at, x)
            store(s, at + row, y)
            store(s, at + 2 * row, cosine)
            store(s, at + 3 * row, sine)
            store(s, at + 4 * row, speed)
            store(s, at + 5 * row, turn_rate)


@compiled
def lay_out_task(c: Record, s: FloatArray) -> None:
    """Write what every tracker of every world is told of its task to a row of scratch memory."""
    for k in range(2 * WIDTH):
        s[TASK + k] = _ZERO
    s[TASK + c.formation] = _ONE
    s[TASK + 4] = np.float32(c.num_trackers)
    s[TASK + 5] = c.formation_distance
    s[TASK + 6] = c.formation_spacing
    s[TASK + 7] = c.tracker_speed
    s[TASK + 8] = c.tracker_turn_rate
    s[TASK + 9] = c.acceleration_time
    s[TASK + 10] = c.turn_acceleration_time
    s[TASK + 11] = c.tolerance
    s[TASK + 12] = c.radius
    s[TASK + 13] = c.dt
    s[TASK + 14] = c.told_sensing_range
    s[TASK + 15] = c.sonar_range


@compiled
def write_task(number: int, s: FloatArray, o: FloatArray) -> None:
    """Write what a tracker is told of its task, but for the last two."""
    store(o, TASK_AT, choose(load(s, INDEX) == _NUMBER_AT, np.float32(number), load(s, TASK)))
    store(o, TASK_AT + WIDTH, load(s, TASK + WIDTH))


@compiled
def _write_rows(
    rows: tuple[Lanes, ...],
    e: int,
    i: int,
    count: int,
    across: int,
    observations: FloatArray,
    k: int,
) -> None:
    """Write eight numbers to each of ``count`` observations, from k on."""
    a, b, c, d, f, g, h, j = rows
    # Not in a loop: which of a tuple is meant would be looked up at run time.
    _write_row(a, 0, e, i, count, across, observations, k)
    _write_row(b, 1, e, i, count, across, observations, k)
    _write_row(c, 2, e, i, count, across, observations, k)
    _write_row(d, 3, e, i, count, across, observations, k)
    _write_row(f, 4, e, i, count, across, observations, k)
    _write_row(g, 5, e, i, count, across, observations, k)
    _write_row(h, 6, e, i, count, across, observations, k)
    _write_row(j, 7, e, i, count, across, observations, k)


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


@compiled
def observe_own_and_target(
    c: Record,
    world: Records,
    tracker: Records,
    e: int,
    i: int,
    count: int,
    across: int,
    s: FloatArray,
    observations: FloatArray,
) -> None:
    """Write what observers know of themselves and of their target.

    They are ``count`` trackers, the first of them i of world e.
    """
    for lane in range(count):
        to, who = natural(e + lane * across), natural(i + lane * (1 - across))
        t, o = tracker[to, who], observations[to, who]
        s[_STEP + lane] = np.float32(world[to].step)
        s[_FIXED_AT + lane], s[_SEES + lane] = np.float32(t.fix_step), np.float32(t.sees)
        s[_TOUCHING + lane] = np.float32(t.touching)
        s[_WORKING + lane] = np.float32(t.broken_at == NEVER)
        write_task(who, s, o)
    own_x, own_y, hc, hs, speed, turn_rate, _, _ = _columns(tracker, e, i, across, POSE)
    own = transpose(
        within_one(hc), within_one(hs), own_x, own_y, speed, turn_rate,
        load(s, _TOUCHING), load(s, _WORKING),
    )  # fmt: skip
    _write_rows(own, e, i, count, across, observations, 0)
    x, y, heading_x, heading_y, frame_x, frame_y, vx, vy = _columns(tracker, e, i, across, FIX)
    dx, dy = x - own_x, y - own_y
    distance = root(dx * dx + dy * dy)
    per_metre = _ONE / greater(distance, _TINY)
    ux, uy = dx * per_metre, dy * per_metre
    fixed_at = load(s, _FIXED_AT)
    known = fixed_at >= _ZERO
    age = choose(known, (load(s, _STEP) - fixed_at) * c.dt, _MINUS_ONE)
    ahead = choose(distance > _ZERO, within_one(ux * hc + uy * hs), _ONE)
    ahead = choose(known, ahead, _ZERO)
    left = choose(known, within_one(uy * hc - ux * hs), _ZERO)
    heading_cos = choose(known, within_one(heading_x * hc + heading_y * hs), _ZERO)
    heading_sin = choose(known, within_one(heading_y * hc - heading_x * hs), _ZERO)
    frame_cos = choose(known, within_one(frame_x * hc + frame_y * hs), _ZERO)
    frame_sin = choose(known, within_one(frame_y * hc - frame_x * hs), _ZERO)
    # The end of the task and the first of the target; then its last, eight at once.
    time_left = (np.float32(c.horizon) - load(s, _STEP)) * c.dt
    fields = transpose(
        eight(c.told_arena), time_left, choose(known, _ONE, _ZERO), load(s, _SEES), age,
        choose(known, distance, _MINUS_ONE), ahead, left,
    )  # fmt: skip
    _write_rows(fields, e, i, count, across, observations, TARGET_AT - 2)
    fields = transpose(
        ahead, left, heading_cos, heading_sin, frame_cos, frame_sin,
        choose(known, vx * hc + vy * hs, _ZERO), choose(known, vy * hc - vx * hs, _ZERO),
    )  # fmt: skip
    _write_rows(fields, e, i, count, across, observations, TARGET_AT + 4)


@compiled
def _number(n: int, i: int, m: int, across: int, s: FloatArray) -> Lanes:
    """Return the numbers of the team-mates m + 1 places behind their observers."""
    number = (eight(np.float32(i)) if across else load(s, INDEX + i)) + np.float32(m + 1)
    return choose(number >= np.float32(n), number - np.float32(n), number)


@compiled
def _seen_at(n: int, i: int, m: int, across: int, s: FloatArray) -> tuple[Lanes, Lanes]:
    """Return where the team-mates m + 1 places behind their observers are: ahead and left, m."""
    stride, row = _stride(across), _row(n, across)
    own = TEAM + natural(stride * i)
    at = own + natural(stride * (m + 1))
    dx, dy = load(s, at) - load(s, own), load(s, at + row) - load(s, own + row)
    hc, hs = load(s, own + 2 * row), load(s, own + 3 * row)
    return dx * hc + dy * hs, dy * hc - dx * hs


@compiled
def _find_places(n: int, i: int, across: int, s: FloatArray) -> None:
    """Write how far each team-mate is from its observers, and how many are nearer.

    Or as near, and of a lower number.
    """
    for m in range(n - 1):
        ahead, left = _seen_at(n, i, m, across, s)
        distance = root(ahead * ahead + left * left)
        number, place = _number(n, i, m, across, s), eight(_ZERO)
        for q in range(m):
            other, before = load(s, _DISTANCE + WIDTH * q), _number(n, i, q, across, s) < number
            nearer = (other < distance) | ((other == distance) & before)
            place = place + choose(nearer, _ONE, _ZERO)
            store(s, _PLACE + WIDTH * q, load(s, _PLACE + WIDTH * q) + choose(nearer, _ZERO, _ONE))
        store(s, _DISTANCE + WIDTH * m, distance)
        store(s, _PLACE + WIDTH * m, place)


@compiled
def observe_team(
    c: Record,
    e: int,
    i: int,
    count: int,
    across: int,
    message: FloatArray,
    s: FloatArray,
    observations: FloatArray,
    k: int,
) -> None:
    """Write every team-mate of observers from k on, nearest first: each has a place.

    They are ``count`` trackers, the first of them i of world e.
    """
    n, size = natural(c.num_trackers), np.float32(9 + c.message_size)
    stride, row = _stride(across), _row(n, across)
    own = TEAM + natural(stride * i)
    _find_places(n, i, across, s)
    for m in range(n - 1):
        at = own + natural(stride * (m + 1))
        ahead, left = _seen_at(n, i, m, across, s)
        first, second, third, fourth, fifth, sixth, seventh, eighth = describe_mates(
            load(s, own + 2 * row), load(s, own + 3 * row), _number(n, i, m, across, s),
            ahead, left, load(s, _DISTANCE + WIDTH * m),
            load(s, at + 2 * row), load(s, at + 3 * row), load(s, at + 4 * row),
        )  # fmt: skip
        store(s, _START, load(s, _PLACE + WIDTH * m) * size + np.float32(k))
        turn_rates = at + 5 * row
        _write_mate(c, first, 0, e, i, count, across, turn_rates, message, s, observations)
        _write_mate(c, second, 1, e, i, count, across, turn_rates, message, s, observations)
        _write_mate(c, third, 2, e, i, count, across, turn_rates, message, s, observations)
        _write_mate(c, fourth, 3, e, i, count, across, turn_rates, message, s, observations)
        _write_mate(c, fifth, 4, e, i, count, across, turn_rates, message, s, observations)
        _write_mate(c, sixth, 5, e, i, count, across, turn_rates, message, s, observations)
        _write_mate(c, seventh, 6, e, i, count, across, turn_rates, message, s, observations)
        _write_mate(c, eighth, 7, e, i, count, across, turn_rates, message, s, observations)


@compiled
def _write_mate(
    c: Record,
    fields: Lanes,
    lane: int,
    e: int,
    i: int,
    count: int,
    across: int,
    turn_rates: int,
    message: FloatArray,
    s: FloatArray,
    observations: FloatArray,
) -> None:
    """Write what one of ``count`` observers observes of a team-mate, if there are so many."""
    if lane >= count:
        return
    to = natural(e + lane * across)
    o = observations[to, natural(i + lane * (1 - across))]
    start = natural(int(s[_START + lane]))
    store(o, start, fields)
    o[start + 8] = s[turn_rates + lane]
    if c.message_size > 0:
        copy_message(c, message[to, 0, natural(int(o[start]))], o, start)


@compiled(seldom=True)
def copy_message(c: Record, said: FloatArray, o: FloatArray, k: int) -> None:
    """Write what a team-mate said, (m,), into its place, which begins at k."""
    for q in range(c.message_size):
        o[k + 9 + q] = said[q]


@compiled
def _observe_some(
    c: Record,
    world: Records,
    tracker: Records,
    e: int,
    i: int,
    count: int,
    across: int,
    message: FloatArray,
    s: FloatArray,
    observations: FloatArray,
) -> None:
    """Write what ``count`` trackers, the first of them i of world e, observe together."""
    observe_own_and_target(c, world, tracker, e, i, count, across, s, observations)
    if whole_team(c):
        k = SONAR_AT + natural(c.sonar_beams)
        observe_team(c, e, i, count, across, message, s, observations, k)


@compiled
def observe_together(
    c: Record,
    world: Records,
    tracker: Records,
    e: int,
    worlds: int,
    message: FloatArray,
    s: FloatArray,
    observations: FloatArray,
) -> None:
    """Write what trackers of ``worlds`` worlds, at most eight, from e on, observe together."""
    n = natural(c.num_trackers)
    if worlds == TOGETHER:
        if whole_team(c):
            lay_out_team(tracker, e, 1, s)
        for i in range(n):
            _observe_some(c, world, tracker, e, i, WIDTH, 1, message, s, observations)
        return
    for each in range(e, e + worlds):
        if whole_team(c):
            lay_out_team(tracker, each, 0, s)
        for i in range(0, n, WIDTH):
            count = min(WIDTH, n - i)
            _observe_some(c, world, tracker, each, i, count, 0, message, s, observations)
