"""Where every disc of a world is, laid out so that the processor works on eight of them at once.

Discs (trackers, the target, obstacles) lie side by side in rows of a thread's scratch memory.
Contact, score, target sensor and sonar all start from these rows, and go over them by blocks of
eight (:mod:`posse.numeric.simd.lanes`); what fills the last block is too far away to count.
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
    lesser,
    load,
    load_fields,
    root,
    store,
    transpose,
)
from posse.rules.state import POSE
from posse.scenarios.scenario import MAX_TRACKERS

BLOCK: Final = WIDTH

# Rows of scratch memory: where each begins. 64 trackers, the target and 60 obstacles fit a row, and
# a length that is no power of two keeps rows apart in the processor's cache.
ROW: Final = 136
X: Final = 0  # common frame, m
Y: Final = 1 * ROW
RADIUS: Final = 2 * ROW
INDEX: Final = 3 * ROW  # 0, 1, 2, …
BEAM_COS: Final = 4 * ROW
BEAM_SIN: Final = 5 * ROW
READING: Final = 6 * ROW
TASK: Final = 7 * ROW  # what every tracker is told of its task
PREPARED: Final = 8 * ROW - 1  # not 0 once what is the same for all worlds stands there
GAP: Final = 8 * ROW  # of each tracker: free width to the nearest disc, m
EXCESS: Final = 9 * ROW  # of each tracker: not above 0 if anything is near
SLOT: Final = 10 * ROW  # of each tracker: the nearest slot, or the nearest that is free
SLOT_DISTANCE: Final = 11 * ROW  # and how far it is, m
SLOT_DISTANCE2: Final = 12 * ROW  # the same squared, m²
HEARD2: Final = 13 * ROW  # within which the sonar has it, the square, and a little more, m²
OWN: Final = 14 * ROW  # ten rows whose meaning is their module's own
SHORTLIST: Final = 24 * ROW  # and three for a list of the nearest

# Then the rows of a team (posse.signals.team), which is there twice, and room for the last block:
# of eight worlds, if it is small, or of one.
TEAM: Final = 27 * ROW
TEAM_ROWS: Final = 6
MOST_IN_TEAM: Final = 16
"""Up to this team size, the teams of eight worlds fit there."""

SIZE: Final = TEAM + TEAM_ROWS * (2 * MOST_IN_TEAM * BLOCK + BLOCK)
SIZE_FOR_ONE: Final = TEAM + TEAM_ROWS * (2 * MAX_TRACKERS + BLOCK)
"""Where memory is short: the team of one world fits."""

TOUCHING_GAP: Final = np.float32(0.001)
"""Robots nearer than this touch, m."""

FAR: Final = np.float32(1e9)
_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)
_MINUS_ONE: Final = np.float32(-1.0)
_A_LITTLE_MORE: Final = np.float32(1.0001)  # far more than rounding
_BIT: Final = np.uint64(1)
_NO_BITS: Final = np.uint64(0)


def new_scratch() -> FloatArray:
    """Return scratch memory for one thread and one scenario, SIZE numbers."""
    return np.zeros(SIZE, np.float32)


@compiled
def natural(count: int) -> int:
    """Return a count as it is, and let the compiler know that it is not negative.

    A negative index counts from the end, and numba has every index looked at for that unless it
    can be seen not to be negative.
    """
    return count & 0x7FFFFFFF


@compiled
def blocks(count: int) -> int:
    """Return how many blocks hold ``count`` discs or beams."""
    return (natural(count) + (BLOCK - 1)) >> 3


@compiled
def lay_out_constants(c: Record, beams: FloatArray, s: FloatArray) -> None:
    """Write what is the same for all worlds.

    The directions of the sonar's beams (2, S), of which those that fill a block point nowhere, what
    counts the places of a row, and the robots' radius.
    """
    for k in range(ROW):
        s[INDEX + k] = np.float32(k)
        s[RADIUS + k] = c.radius
        s[HEARD2 + k] = heard_within2(c, c.radius)
    count = beams.shape[1]
    for k in range(BLOCK * blocks(count)):
        s[BEAM_COS + k] = beams[0, k] if k < count else _ZERO
        s[BEAM_SIN + k] = beams[1, k] if k < count else _ZERO


@compiled
def heard_within2(c: Record, radius: np.float32) -> np.float32:
    """Return a squared distance of the centres within which every disc is that the sonar has."""
    within = (c.sonar_range + c.radius + radius) * _A_LITTLE_MORE
    return np.float32(within * within)


@compiled
def columns(records: Records, first: int, count: int, offset: int) -> tuple[Lanes, ...]:
    """Return eight fields that follow on each other, of eight of ``count`` records, field by field.

    From record ``first`` on, beginning ``offset`` bytes into each; the last record stands in for
    those that there are not.
    """
    last = count - 1
    return transpose(
        load_fields(records[natural(min(first, last))], offset),
        load_fields(records[natural(min(first + 1, last))], offset),
        load_fields(records[natural(min(first + 2, last))], offset),
        load_fields(records[natural(min(first + 3, last))], offset),
        load_fields(records[natural(min(first + 4, last))], offset),
        load_fields(records[natural(min(first + 5, last))], offset),
        load_fields(records[natural(min(first + 6, last))], offset),
        load_fields(records[natural(min(first + 7, last))], offset),
    )


@compiled
def store_rows(
    a: Lanes,
    b: Lanes,
    c: Lanes,
    d: Lanes,
    e: Lanes,
    f: Lanes,
    g: Lanes,
    h: Lanes,
    at: int,
    stride: int,
    s: FloatArray,
) -> None:
    """Write what :func:`columns` gives back as it stands in records, ``stride`` apart."""
    store_each(transpose(a, b, c, d, e, f, g, h), at, stride, s)


@compiled
def store_each(rows: tuple[Lanes, ...], at: int, stride: int, s: FloatArray) -> None:
    """Write eight lanes, ``stride`` apart."""
    a, b, c, d, e, f, g, h = rows
    store(s, at, a)
    store(s, at + stride, b)
    store(s, at + 2 * stride, c)
    store(s, at + 3 * stride, d)
    store(s, at + 4 * stride, e)
    store(s, at + 5 * stride, f)
    store(s, at + 6 * stride, g)
    store(s, at + 7 * stride, h)


@compiled
def lay_out(c: Record, w: Record, trackers: Records, obstacles: Records, s: FloatArray) -> None:
    """Write where every disc is: trackers, then the target, then obstacles."""
    n = natural(c.num_trackers)
    for block in range(blocks(n + 1)):
        j = BLOCK * block
        x, y, _, _, _, _, _, _ = columns(trackers, j, n, POSE)
        number = load(s, INDEX + j)
        tracker, target = number < np.float32(n), number == np.float32(n)
        store(s, X + j, choose(tracker, x, choose(target, w.x, FAR)))
        store(s, Y + j, choose(tracker, y, choose(target, w.y, FAR)))
    count = num_discs(c)
    if count > n + 1:
        for k in range(natural(c.num_obstacles)):
            o = obstacles[k]
            j = n + 1 + k
            s[X + j], s[Y + j], s[RADIUS + j] = o.x, o.y, o.radius
            s[HEARD2 + j] = heard_within2(c, o.radius)
        store(s, X + count, eight(FAR))
        store(s, Y + count, eight(FAR))


@compiled
def num_discs(c: Record) -> int:
    """Return how many discs a world has: trackers, the target, obstacles."""
    return natural(c.num_trackers) + 1 + natural(c.num_obstacles)


@compiled
def within_one(value: Lanes) -> Lanes:
    """Return a cosine or sine that rounding may have carried past 1, brought back."""
    return lesser(greater(value, _MINUS_ONE), _ONE)


@compiled
def find_gaps(c: Record, s: FloatArray) -> None:
    """Write each tracker's free width to the nearest disc, and whether one is near (EXCESS ≤ 0).

    Near is what could be touched within the next control step.
    """
    n = natural(c.num_trackers)
    robots = c.radius + c.radius
    tracker_reach = robots + TOUCHING_GAP + (c.tracker_speed + c.tracker_speed) * c.dt
    target_reach = robots + TOUCHING_GAP + (c.target_speed + c.tracker_speed) * c.dt
    margin = TOUCHING_GAP + c.tracker_speed * c.dt
    for block in range(blocks(n)):
        i = BLOCK * block
        x, y, number = load(s, X + i), load(s, Y + i), load(s, INDEX + i)
        # Robots are all of one size: what is nearest is so without a square root for each.
        nearest2 = eight(FAR)
        for j in range(n):
            dx, dy = x - s[X + j], y - s[Y + j]
            # That is j: to read it is faster than to convert it.
            d2 = choose(number == s[INDEX + j], FAR, dx * dx + dy * dy)
            nearest2 = lesser(nearest2, d2)
        dx, dy = x - s[X + n], y - s[Y + n]
        d2 = dx * dx + dy * dy
        excess = lesser(nearest2 - tracker_reach * tracker_reach, d2 - target_reach * target_reach)
        least = root(lesser(nearest2, d2)) - robots
        for j in range(n + 1, num_discs(c)):
            dx, dy = x - s[X + j], y - s[Y + j]
            gap = root(dx * dx + dy * dy) - (c.radius + s[RADIUS + j])
            least, excess = lesser(least, gap), lesser(excess, gap - margin)
        store(s, GAP + i, least)
        store(s, EXCESS + i, excess)


@compiled
def find_slots(
    c: Record, w: Record, first: int, slots: Records, taken: np.uint64, s: FloatArray
) -> None:
    """Write, of eight trackers from ``first`` on, the nearest slot that is not in ``taken``.

    That is a set, a bit each; -1: all are.
    """
    dx, dy = load(s, X + first) - w.x, load(s, Y + first) - w.y
    ahead, left = dx * w.frame_cos + dy * w.frame_sin, dy * w.frame_cos - dx * w.frame_sin
    nearest, nearest2 = eight(_MINUS_ONE), eight(FAR)
    for slot in range(natural(c.num_trackers)):
        if taken & (_BIT << np.uint64(slot)) == _NO_BITS:
            dx, dy = ahead - slots[slot].x, left - slots[slot].y
            d2 = dx * dx + dy * dy
            nearest = choose(d2 < nearest2, s[INDEX + slot], nearest)
            nearest2 = lesser(nearest2, d2)
    store(s, SLOT + first, nearest)
    store(s, SLOT_DISTANCE2 + first, nearest2)
    store(s, SLOT_DISTANCE + first, root(nearest2))
