"""Where every disc of a world is, laid out so that the processor works on eight of them at once.

Discs (trackers, the target, obstacles) lie side by side in rows of a thread's scratch memory.
Contact, score, sonar and the view of team-mates all start from these rows. A loop over a row goes
by blocks of :data:`BLOCK`, a fixed length, which the compiler turns into vector instructions if the
loop is short, free of branches, and reads nothing but rows and plain numbers; what fills the last
block is too far away to count.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from posse.arrays import FloatArray, Record, Records
from posse.compiled import compiled

BLOCK: Final = 8

# Rows of scratch memory: where each begins. 64 trackers, the target and 60 obstacles fit a row, and
# a length that is no power of two keeps rows apart in the processor's cache.
_ROW: Final = 136
X: Final = 0  # common frame, m
Y: Final = 1 * _ROW
RADIUS: Final = 2 * _ROW
COS: Final = 3 * _ROW  # heading, common frame; trackers only
SIN: Final = 4 * _ROW
AHEAD: Final = 5 * _ROW  # ego, m
LEFT: Final = 6 * _ROW
DISTANCE: Final = 7 * _ROW  # of the centres, m
BEARING_COS: Final = 8 * _ROW  # ego
BEARING_SIN: Final = 9 * _ROW
HEADING_COS: Final = 10 * _ROW  # ego; trackers only
HEADING_SIN: Final = 11 * _ROW
BEAM_COS: Final = 12 * _ROW
BEAM_SIN: Final = 13 * _ROW
READING: Final = 14 * _ROW
NEAREST: Final = 15 * _ROW  # a list of team-mates by distance: how far,
NUMBER: Final = 16 * _ROW  # and who
MATE_DISTANCE: Final = 17 * _ROW  # as DISTANCE; what is no tracker is far
GAP: Final = 18 * _ROW  # of each tracker: free width to the nearest disc, m
EXCESS: Final = 19 * _ROW  # of each tracker: not above 0 if anything is near
SLOT: Final = 20 * _ROW  # of each tracker: the nearest slot
SLOT_DISTANCE2: Final = 21 * _ROW  # and its distance squared, m²
ROOM_AHEAD: Final = 22 * _ROW  # of each direction, for a target that flees
ROOM_ASTERN: Final = 23 * _ROW
INDEX: Final = 24 * _ROW  # 0, 1, 2, …
TASK: Final = 25 * _ROW  # what every tracker is told of its task
MATE_AHEAD: Final = 26 * _ROW  # of team-mates by place
MATE_LEFT: Final = 27 * _ROW
MATE_COS: Final = 28 * _ROW
MATE_SIN: Final = 29 * _ROW
CANDIDATE: Final = 30 * _ROW  # how far those are that may be among the nearest,
CANDIDATE_NUMBER: Final = 31 * _ROW  # and who they are
LANE: Final = 32 * _ROW
RANK: Final = 33 * _ROW
SIZE: Final = 34 * _ROW

TOUCHING_GAP: Final = np.float32(0.001)
"""Robots nearer than this touch, m."""

FAR: Final = np.float32(1e9)
_NEARER_THAN_FAR: Final = np.float32(0.9e9)
_PLACES: Final = np.float32(BLOCK)
_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)
_MINUS_ONE: Final = np.float32(-1.0)
_TINY: Final = np.float32(1e-9)
_BIT: Final = np.uint64(1)
_NO_BITS: Final = np.uint64(0)


def new_scratch() -> FloatArray:
    """Return scratch memory for one thread."""
    return np.zeros(SIZE, np.float32)


@compiled
def natural(count: int) -> int:
    """Return a count as it is, and let the compiler know that it is not negative.

    A negative index counts from the end, and numba has every index looked at for that unless it
    can be seen not to be negative.
    """
    return count & 0x7FFFFFFF


@compiled
def lesser(kept: np.float32, value: np.float32) -> np.float32:
    """Return the lesser of two numbers, where the first was read from where it is to be kept.

    Adding nothing to it stops the compiler from storing only where it changes: processors that
    have such a masked store may take a hundred times as long over it as over a plain one.
    """
    return min(kept + _ZERO, value)


@compiled
def blocks(count: int) -> int:
    """Return how many blocks hold ``count`` discs or beams."""
    return (natural(count) + (BLOCK - 1)) >> 3


@compiled
def copy_block(s: FloatArray, source: int, o: FloatArray, target: int) -> None:
    """Copy eight numbers of scratch memory.

    All are read before one is written, so that the compiler need not ask whether the two overlap.
    """
    a, b, c, d = s[source], s[source + 1], s[source + 2], s[source + 3]
    e, f, g, h = s[source + 4], s[source + 5], s[source + 6], s[source + 7]
    o[target], o[target + 1], o[target + 2], o[target + 3] = a, b, c, d
    o[target + 4], o[target + 5], o[target + 6], o[target + 7] = e, f, g, h


@compiled
def lay_out_beams(beams: FloatArray, s: FloatArray) -> None:
    """Write the directions of the sonar's beams (2, S), and what counts the places of a row.

    Beams that fill a block point nowhere.
    """
    for k in range(_ROW):
        s[INDEX + k] = np.float32(k)
    count = beams.shape[1]
    for k in range(BLOCK * blocks(count)):
        s[BEAM_COS + k] = beams[0, k] if k < count else _ZERO
        s[BEAM_SIN + k] = beams[1, k] if k < count else _ZERO


@compiled
def lay_out(c: Record, w: Record, trackers: Records, obstacles: Records, s: FloatArray) -> None:
    """Write where every disc is: trackers, then the target, then obstacles."""
    n = natural(c.num_trackers)
    for j in range(n):
        t = trackers[j]
        s[X + j], s[Y + j], s[RADIUS + j] = t.x, t.y, c.radius
        s[COS + j], s[SIN + j] = t.heading_cos, t.heading_sin
    s[X + n], s[Y + n], s[RADIUS + n] = w.x, w.y, c.radius
    for k in range(natural(c.num_obstacles)):
        o = obstacles[k]
        j = n + 1 + k
        s[X + j], s[Y + j], s[RADIUS + j] = o.x, o.y, o.radius
    count = num_discs(c)
    for j in range(count, BLOCK * blocks(count)):
        s[X + j], s[Y + j], s[RADIUS + j] = FAR, FAR, _ZERO


@compiled
def num_discs(c: Record) -> int:
    """Return how many discs a world has: trackers, the target, obstacles."""
    return natural(c.num_trackers) + 1 + natural(c.num_obstacles)


@compiled
def survey(c: Record, robot: Record, number: int, s: FloatArray) -> None:
    """Write where every disc is as the robot sees it; its own, ``number``, is too far to count."""
    x, y, hc, hs = robot.x, robot.y, robot.heading_cos, robot.heading_sin
    own = np.float32(number)
    for block in range(blocks(num_discs(c))):
        for k in range(BLOCK):
            j = BLOCK * block + k
            dx, dy = s[X + j] - x, s[Y + j] - y
            ahead, left = dx * hc + dy * hs, dy * hc - dx * hs
            s[AHEAD + j], s[LEFT + j] = ahead, left
            distance = np.float32(math.sqrt(ahead * ahead + left * left))
            s[DISTANCE + j] = FAR if s[INDEX + j] == own else distance


@compiled
def find_directions(
    robot: Record,
    count: int,
    ahead: int,
    left: int,
    distance: int,
    cosine: int,
    sine: int,
    s: FloatArray,
) -> None:
    """Write the ego directions of ``count`` team-mates and of their headings.

    From the rows that hold where they are (``ahead``, ``left``, ``distance``) and their headings in
    the common frame (``cosine``, ``sine``).
    """
    hc, hs = robot.heading_cos, robot.heading_sin
    for block in range(blocks(count)):
        for k in range(BLOCK):
            j = BLOCK * block + k
            per_metre = _ONE / max(s[distance + j], _TINY)
            s[BEARING_COS + j] = within_one(s[ahead + j] * per_metre)
            s[BEARING_SIN + j] = within_one(s[left + j] * per_metre)
        for k in range(BLOCK):
            j = BLOCK * block + k
            c, n = s[cosine + j], s[sine + j]
            s[HEADING_COS + j] = within_one(c * hc + n * hs)
            s[HEADING_SIN + j] = within_one(n * hc - c * hs)


@compiled
def within_one(value: np.float32) -> np.float32:
    """Return a cosine or sine that rounding may have carried past 1, brought back."""
    return min(max(value, _MINUS_ONE), _ONE)


@compiled
def keep_team(n: int, s: FloatArray) -> None:
    """Write the distances of trackers alone, everything else being far."""
    count = np.float32(n)
    for block in range(blocks(n)):
        for k in range(BLOCK):
            j = BLOCK * block + k
            distance = s[DISTANCE + j]
            s[MATE_DISTANCE + j] = distance if s[INDEX + j] < count else FAR


@compiled
def place_of(j: int, n: int, distances: int, s: FloatArray) -> int:
    """Return the place by distance of j, in a row of n: how many are nearer, or as near and first.

    What fills the row's last block has to be far.
    """
    mine, number = s[distances + j], np.float32(j)
    nearer = np.int32(0)
    for block in range(blocks(n)):
        for k in range(BLOCK):
            i = BLOCK * block + k
            d = s[distances + i]
            nearer += np.int32((d < mine) | ((d == mine) & (s[INDEX + i] < number)))
    return int(nearer)


@compiled
def bound_nearest(n: int, s: FloatArray) -> np.float32:
    """Return a distance within which the eight nearest of n team-mates are, and few others.

    The team is dealt out to sixteen lanes. The nearest of each lane are sixteen team-mates, so none
    of the eight nearest is farther than the eighth of these.
    """
    for k in range(BLOCK):
        s[LANE + k] = FAR
        s[LANE + BLOCK + k] = FAR
        s[RANK + k] = _ZERO
        s[RANK + BLOCK + k] = _ZERO
    for block in range(blocks(n)):
        lane = LANE + BLOCK * (block & 1)
        for k in range(BLOCK):
            s[lane + k] = lesser(s[lane + k], s[MATE_DISTANCE + BLOCK * block + k])
    for i in range(2 * BLOCK):
        nearer = s[LANE + i]
        for k in range(BLOCK):
            s[RANK + k] += _ONE if nearer < s[LANE + k] else _ZERO
        for k in range(BLOCK):
            s[RANK + BLOCK + k] += _ONE if nearer < s[LANE + BLOCK + k] else _ZERO
    for k in range(BLOCK):
        first, second = s[LANE + k], s[LANE + BLOCK + k]
        first = first if s[RANK + k] < _PLACES else _ZERO
        second = second if s[RANK + BLOCK + k] < _PLACES else _ZERO
        s[LANE + k] = max(first, second)
    left = max(max(s[LANE], s[LANE + 1]), max(s[LANE + 2], s[LANE + 3]))
    right = max(max(s[LANE + 4], s[LANE + 5]), max(s[LANE + 6], s[LANE + 7]))
    return min(max(left, right), _NEARER_THAN_FAR)


@compiled
def choose_nearest(n: int, places: int, s: FloatArray) -> int:
    """List the nearest of n team-mates, NEAREST first; return how many, at most ``places``.

    MATE_DISTANCE says how far each is, FAR for those that do not count.
    """
    most = bound_nearest(n, s) if places <= BLOCK else _NEARER_THAN_FAR
    count = 0
    for j in range(natural(n)):  # without a branch, which could not be predicted
        distance = s[MATE_DISTANCE + j]
        s[CANDIDATE + count], s[CANDIDATE_NUMBER + count] = distance, s[INDEX + j]
        count = natural(count + int(distance <= most))
    for k in range(count, BLOCK * blocks(count)):
        s[CANDIDATE + k] = FAR
    for q in range(count):
        place = natural(place_of(q, count, CANDIDATE, s))
        if place < places:
            s[NEAREST + place] = s[CANDIDATE + q]
            s[NUMBER + place] = s[CANDIDATE_NUMBER + q]
    return min(count, places)


@compiled
def find_gaps(c: Record, s: FloatArray) -> None:
    """Write each tracker's free width to the nearest disc, and whether one is near (EXCESS ≤ 0).

    Near is what could be touched within the next control step.
    """
    n = natural(c.num_trackers)
    for block in range(blocks(n)):
        for k in range(BLOCK):
            s[GAP + BLOCK * block + k] = FAR
            s[EXCESS + BLOCK * block + k] = FAR
    robots = c.radius + c.radius
    for j in range(n + 1):
        # Robots are all of one size: what is nearest is so without a square root for each.
        x, y, number = s[X + j], s[Y + j], np.float32(j)
        speed = c.tracker_speed if j < n else c.target_speed
        reach = robots + TOUCHING_GAP + (speed + c.tracker_speed) * c.dt
        for block in range(blocks(n)):
            for k in range(BLOCK):
                i = BLOCK * block + k
                dx, dy = s[X + i] - x, s[Y + i] - y
                d2 = dx * dx + dy * dy
                d2 = FAR if s[INDEX + i] == number else d2
                s[GAP + i] = lesser(s[GAP + i], d2)
                s[EXCESS + i] = lesser(s[EXCESS + i], d2 - reach * reach)
    for block in range(blocks(n)):
        for k in range(BLOCK):
            i = BLOCK * block + k
            s[GAP + i] = np.float32(math.sqrt(s[GAP + i])) - robots
    for j in range(n + 1, num_discs(c)):
        x, y, both = s[X + j], s[Y + j], c.radius + s[RADIUS + j]
        margin = TOUCHING_GAP + c.tracker_speed * c.dt
        for block in range(blocks(n)):
            for k in range(BLOCK):
                i = BLOCK * block + k
                dx, dy = s[X + i] - x, s[Y + i] - y
                gap = np.float32(math.sqrt(dx * dx + dy * dy)) - both
                s[GAP + i] = lesser(s[GAP + i], gap)
                s[EXCESS + i] = lesser(s[EXCESS + i], gap - margin)


@compiled
def find_slots(c: Record, w: Record, slots: Records, taken: np.uint64, s: FloatArray) -> None:
    """Write each tracker's nearest slot that is not in the set ``taken``; -1: all are."""
    n = c.num_trackers
    for block in range(blocks(n)):
        for k in range(BLOCK):
            i = BLOCK * block + k
            dx, dy = s[X + i] - w.x, s[Y + i] - w.y
            s[AHEAD + i] = dx * w.frame_cos + dy * w.frame_sin
            s[LEFT + i] = dy * w.frame_cos - dx * w.frame_sin
            s[SLOT + i] = _MINUS_ONE
            s[SLOT_DISTANCE2 + i] = FAR
    for slot in range(n):
        if taken & (_BIT << np.uint64(slot)) != _NO_BITS:
            continue
        x, y, number = slots[slot].x, slots[slot].y, np.float32(slot)
        for block in range(blocks(n)):
            for k in range(BLOCK):
                i = BLOCK * block + k
                dx, dy = s[AHEAD + i] - x, s[LEFT + i] - y
                d2, kept = dx * dx + dy * dy, s[SLOT + i] + _ZERO
                s[SLOT + i] = number if d2 < s[SLOT_DISTANCE2 + i] else kept
                s[SLOT_DISTANCE2 + i] = lesser(s[SLOT_DISTANCE2 + i], d2)
