"""Which team-mates are nearest to a tracker, where the team is larger than what is observed of it.

Two ways that give the same list. Eight trackers at once, a lane each: the squared distances to
eight team-mates are sorted and merged with the nearest so far, without a branch. That keeps a
distance to five digits and six bits of who it is; where two distances are nearer to each other than
that can tell, the list is made again the other way, one by one and exactly.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posse.arrays import FloatArray, Record, Records
from posse.compiled import compiled
from posse.lanes import Lanes, choose, eight, greater, lesser, load, root, store, tag, tagged
from posse.survey import (
    BLOCK,
    FAR,
    INDEX,
    LISTED,
    ROW,
    SHORTLIST,
    X,
    Y,
    blocks,
    find_places,
    natural,
    store_each,
)

# Rows of scratch memory: how far each team-mate is, which of them may be among the nearest and how
# far, by place; what the lanes hold; which of eight lists are beyond doubt.
_DISTANCE: Final = SHORTLIST
_CANDIDATE: Final = SHORTLIST + 1 * ROW
_CANDIDATE_NUMBER: Final = SHORTLIST + 2 * ROW
_PLACE: Final = SHORTLIST + 3 * ROW
_LANE: Final = SHORTLIST + 4 * ROW
_CERTAIN: Final = SHORTLIST + 5 * ROW

_PLACES: Final = np.float32(BLOCK)
_NEARER_THAN_FAR: Final = np.float32(0.9e9)
_CLOSER: Final = np.float32(1 - 2**-15)  # two tags and rounding change half of that
_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)

_Eight = tuple[Lanes, Lanes, Lanes, Lanes, Lanes, Lanes, Lanes, Lanes]


@compiled
def list_nearest(c: Record, trackers: Records, first: int, count: int, s: FloatArray) -> None:
    """List the nearest team-mates of ``count`` trackers, at most eight, from ``first`` on.

    Their nearest stand side by side from LISTED on, a lane each, then their second nearest.
    """
    together = c.neighbours <= BLOCK < c.num_trackers - 1
    if together:
        rank_eight(c.num_trackers, first, s)
    for lane in range(count):
        if not together or s[_CERTAIN + lane] == _ZERO:
            measure_team(c.num_trackers, trackers[first + lane], first + lane, s)
            choose_nearest(c.num_trackers, c.neighbours, natural(lane), s)


@compiled
def rank_eight(n: int, first: int, s: FloatArray) -> None:
    """List the eight nearest team-mates of eight trackers, and say which lists are certain.

    There are at least nine team-mates.
    """
    x, y = load(s, X + first), load(s, Y + first)
    a = b = c = d = e = f = g = h = ninth = eight(FAR)
    for block in range(blocks(n)):
        j = BLOCK * block
        others = (
            apart(n, j, x, y, s), apart(n, j + 1, x, y, s), apart(n, j + 2, x, y, s),
            apart(n, j + 3, x, y, s), apart(n, j + 4, x, y, s), apart(n, j + 5, x, y, s),
            apart(n, j + 6, x, y, s), apart(n, j + 7, x, y, s),
        )  # fmt: skip
        if j == first:
            others = without_self(others, s)
        a, b, c, d, e, f, g, h, least = merge((a, b, c, d, e, f, g, h), sort(others))
        ninth = lesser(ninth, least)
    doubtful = (
        (b * _CLOSER <= a) | (c * _CLOSER <= b) | (d * _CLOSER <= c) | (e * _CLOSER <= d)
        | (f * _CLOSER <= e) | (g * _CLOSER <= f) | (h * _CLOSER <= g) | (ninth * _CLOSER <= h)
    )  # fmt: skip
    store(s, _CERTAIN, choose(doubtful, _ZERO, _ONE))
    lists = tag(a), tag(b), tag(c), tag(d), tag(e), tag(f), tag(g), tag(h)
    store_each(lists, LISTED, BLOCK, s)


@compiled
def apart(n: int, j: int, x: Lanes, y: Lanes, s: FloatArray) -> Lanes:
    """Return the squared distances of eight trackers to number j of a team of n, tagged with j."""
    dx, dy = choose(j < n, s[X + j], FAR) - x, s[Y + j] - y
    return tagged(dx * dx + dy * dy, j)


@compiled
def without_self(to: _Eight, s: FloatArray) -> _Eight:
    """Return the distances of eight to themselves, with nobody near to itself."""
    a, b, c, d, e, f, g, h = to
    lane = load(s, INDEX)
    return (
        choose(lane == np.float32(0), FAR, a), choose(lane == np.float32(1), FAR, b),
        choose(lane == np.float32(2), FAR, c), choose(lane == np.float32(3), FAR, d),
        choose(lane == np.float32(4), FAR, e), choose(lane == np.float32(5), FAR, f),
        choose(lane == np.float32(6), FAR, g), choose(lane == np.float32(7), FAR, h),
    )  # fmt: skip


@compiled
def in_order(value: Lanes, other: Lanes) -> tuple[Lanes, Lanes]:
    """Return the lesser and the greater, lane by lane."""
    return lesser(value, other), greater(value, other)


@compiled
def sort(eight_of: _Eight) -> _Eight:
    """Return eight in order, the least first, lane by lane (19 comparisons)."""
    a, b, c, d, e, f, g, h = eight_of
    (a, c), (b, d) = in_order(a, c), in_order(b, d)
    (e, g), (f, h) = in_order(e, g), in_order(f, h)
    (a, e), (b, f) = in_order(a, e), in_order(b, f)
    (c, g), (d, h) = in_order(c, g), in_order(d, h)
    (a, b), (c, d) = in_order(a, b), in_order(c, d)
    (e, f), (g, h) = in_order(e, f), in_order(g, h)
    (c, e), (d, f) = in_order(c, e), in_order(d, f)
    (b, e), (d, g) = in_order(b, e), in_order(d, g)
    (b, c), (d, e) = in_order(b, c), in_order(d, e)
    f, g = in_order(f, g)
    return a, b, c, d, e, f, g, h


@compiled
def merge(one: _Eight, other: _Eight) -> tuple[Lanes, ...]:
    """Return the eight least of two eights in order, in order, and the least of the rest."""
    a, b, c, d, e, f, g, h = one
    i, j, k, l, m, n, o, p = other  # noqa: E741
    least = lesser(
        lesser(lesser(greater(a, p), greater(b, o)), lesser(greater(c, n), greater(d, m))),
        lesser(lesser(greater(e, l), greater(f, k)), lesser(greater(g, j), greater(h, i))),
    )
    # First up, then down: three rounds of comparisons put that in order.
    a, b, c, d = lesser(a, p), lesser(b, o), lesser(c, n), lesser(d, m)
    e, f, g, h = lesser(e, l), lesser(f, k), lesser(g, j), lesser(h, i)
    (a, e), (b, f) = in_order(a, e), in_order(b, f)
    (c, g), (d, h) = in_order(c, g), in_order(d, h)
    (a, c), (b, d) = in_order(a, c), in_order(b, d)
    (e, g), (f, h) = in_order(e, g), in_order(f, h)
    (a, b), (c, d) = in_order(a, b), in_order(c, d)
    (e, f), (g, h) = in_order(e, f), in_order(g, h)
    return a, b, c, d, e, f, g, h, least


@compiled
def measure_team(n: int, robot: Record, number: int, s: FloatArray) -> None:
    """Write how far each of a team of n is from a robot; itself and what is no tracker are far."""
    own = np.float32(number)
    for block in range(blocks(n)):
        j = BLOCK * block
        dx, dy, who = load(s, X + j) - robot.x, load(s, Y + j) - robot.y, load(s, INDEX + j)
        ahead = dx * robot.heading_cos + dy * robot.heading_sin
        left = dy * robot.heading_cos - dx * robot.heading_sin
        distance = choose(who == own, FAR, root(ahead * ahead + left * left))
        store(s, _DISTANCE + j, choose(who < np.float32(n), distance, FAR))


@compiled
def bound_nearest(n: int, s: FloatArray) -> np.float32:
    """Return a distance within which the eight nearest of n team-mates are, and few others.

    The team is dealt out to sixteen lanes. The nearest of each lane are sixteen team-mates, so none
    of the eight nearest is farther than the eighth of these.
    """
    first, second = eight(FAR), eight(FAR)
    for block in range(blocks(n)):
        distance = load(s, _DISTANCE + BLOCK * block)
        if block & 1:
            second = lesser(second, distance)
        else:
            first = lesser(first, distance)
    store(s, _LANE, first)
    store(s, _LANE + BLOCK, second)
    first_rank, second_rank = eight(_ZERO), eight(_ZERO)
    for i in range(2 * BLOCK):
        nearer = s[_LANE + i]
        first_rank = first_rank + choose(first > nearer, _ONE, _ZERO)
        second_rank = second_rank + choose(second > nearer, _ONE, _ZERO)
    first = choose(first_rank < _PLACES, first, _ZERO)
    second = choose(second_rank < _PLACES, second, _ZERO)
    store(s, _LANE, greater(first, second))
    left = max(max(s[_LANE], s[_LANE + 1]), max(s[_LANE + 2], s[_LANE + 3]))
    right = max(max(s[_LANE + 4], s[_LANE + 5]), max(s[_LANE + 6], s[_LANE + 7]))
    return min(max(left, right), _NEARER_THAN_FAR)


@compiled
def choose_nearest(n: int, places: int, lane: int, s: FloatArray) -> None:
    """List the nearest of n team-mates of the tracker in a lane."""
    most = bound_nearest(n, s) if places <= BLOCK else _NEARER_THAN_FAR
    count = 0
    for j in range(natural(n)):  # without a branch, which could not be predicted
        distance = s[_DISTANCE + j]
        s[_CANDIDATE + count], s[_CANDIDATE_NUMBER + count] = distance, s[INDEX + j]
        count = natural(count + int(distance <= most))
    find_places(count, _CANDIDATE, _PLACE, s)
    for q in range(count):
        s[LISTED + lane + BLOCK * natural(int(s[_PLACE + q]))] = s[_CANDIDATE_NUMBER + q]
