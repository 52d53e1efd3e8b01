"""Nearest team-mates of eight trackers, one per lane.

Up to eight nearest are found for all lanes at once: squared distances to eight team-mates are
sorted by a sorting network and merged with the nearest so far. A tag of six bits with the mate's
index replaces the last bits of a distance; where two distances are too close to be distinguished,
the lane's list is computed again by an exact insertion sort, as longer lists always are.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posse.numeric import WIDTH, Lanes, Mask, Record, choose, compiled, eight, greater, lesser, root, store, tag, tagged
from posse.rules.discs import FAR, blocks, natural, store_each
from posse.signals.observation.team import own_numbers, round_again, stride_of, way_behind

_CLOSER: Final = np.float32(1 - 2**-15)  # two tags and rounding change half of that
_ABSENT: Final = FAR * FAR
_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)

_Eight = tuple[Lanes, Lanes, Lanes, Lanes, Lanes, Lanes, Lanes, Lanes]


@compiled
def list_nearest(n: int, places: int, i: int, count: int, across: int, s: Record) -> None:
    """List the nearest of a team of n to ``count`` trackers, the first of them i.

    At most eight; other lanes are undefined. Requires no more places than team-mates, and the
    team's rows (:func:`posse.signals.observation.team.lay_out_team`).
    """
    together = places <= WIDTH
    if together:
        rank_eight(n, i, across, s)
    for lane in range(count):
        if not together or s.certain[lane] == _ZERO:
            list_exactly(n, places, i, natural(lane), across, s)


@compiled
def rank_eight(n: int, i: int, across: int, s: Record) -> None:
    """List the eight nearest team-mates of eight trackers, and mark the lists that are certain."""
    last = WIDTH * (blocks(n - 1) - 1)
    a, b, c, d, e, f, g, h = sort(eight_apart(n, i, last, False, across, s))
    ninth = eight(_ABSENT)
    for m in range(0, last, WIDTH):
        others = sort(eight_apart(n, i, m, True, across, s))
        a, b, c, d, e, f, g, h, least = merge((a, b, c, d, e, f, g, h), others)
        ninth = lesser(ninth, least)
    doubtful = (
        as_near(a, b)
        | as_near(b, c)
        | as_near(c, d)
        | as_near(d, e)
        | as_near(e, f)
        | as_near(f, g)
        | as_near(g, h)
        | as_near(h, ninth)
    )
    store(s.certain, 0, choose(doubtful, _ZERO, _ONE))
    behind = own_numbers(i, across, s) + _ONE
    lists = (
        whose(n, behind, a),
        whose(n, behind, b),
        whose(n, behind, c),
        whose(n, behind, d),
        whose(n, behind, e),
        whose(n, behind, f),
        whose(n, behind, g),
        whose(n, behind, h),
    )
    store_each(lists, s.listed, 0)


@compiled
def as_near(one: Lanes, next_one: Lanes) -> Mask:
    """Return whether a distance is too close to the next one to be distinguished with tags."""
    return (next_one * _CLOSER <= one) & (one < _ABSENT)


@compiled
def whose(n: int, behind: Lanes, distance: Lanes) -> Lanes:
    """Return the numbers of the mates of tagged distances; ``behind``: of the next mates."""
    return round_again(n, behind + tag(distance))


@compiled
def eight_apart(n: int, i: int, m: int, all_there: bool, across: int, s: Record) -> _Eight:
    """Return tagged distances of the eight team-mates from m + 1 places behind eight trackers.

    Absent ones are far away.
    """
    return (
        apart(n, i, m, all_there, across, s),
        apart(n, i, m + 1, all_there, across, s),
        apart(n, i, m + 2, all_there, across, s),
        apart(n, i, m + 3, all_there, across, s),
        apart(n, i, m + 4, all_there, across, s),
        apart(n, i, m + 5, all_there, across, s),
        apart(n, i, m + 6, all_there, across, s),
        apart(n, i, m + 7, all_there, across, s),
    )


@compiled
def apart(n: int, i: int, m: int, is_there: bool, across: int, s: Record) -> Lanes:
    """Return the squared distances to the team-mates m + 1 places behind, tagged with m.

    Values read for an absent mate are undefined, possibly NaN.
    """
    dx, dy = way_behind(i, m, across, s)
    least = choose(is_there or m < n - 1, _ZERO, _ABSENT)
    # Last, an operation on floats: LLVM sorts bit patterns more slowly.
    return greater(least, tagged(dx * dx + dy * dy, m))


@compiled
def in_order(value: Lanes, other: Lanes) -> tuple[Lanes, Lanes]:
    """Return the lesser and the greater, lane by lane."""
    return lesser(value, other), greater(value, other)


@compiled
def sort(eight_of: _Eight) -> _Eight:
    """Return eight values sorted in ascending order, lane by lane (19 comparisons)."""
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
    """Merge two sorted eights: return the eight least, sorted, and the least of the rest."""
    a, b, c, d, e, f, g, h = one
    i, j, k, l, m, n, o, p = other  # noqa: E741
    least = lesser(
        lesser(lesser(greater(a, p), greater(b, o)), lesser(greater(c, n), greater(d, m))),
        lesser(lesser(greater(e, l), greater(f, k)), lesser(greater(g, j), greater(h, i))),
    )
    # A bitonic sequence: three rounds of comparisons sort it.
    a, b, c, d = lesser(a, p), lesser(b, o), lesser(c, n), lesser(d, m)
    e, f, g, h = lesser(e, l), lesser(f, k), lesser(g, j), lesser(h, i)
    (a, e), (b, f) = in_order(a, e), in_order(b, f)
    (c, g), (d, h) = in_order(c, g), in_order(d, h)
    (a, c), (b, d) = in_order(a, c), in_order(b, d)
    (e, g), (f, h) = in_order(e, g), in_order(f, h)
    (a, b), (c, d) = in_order(a, b), in_order(c, d)
    (e, f), (g, h) = in_order(e, f), in_order(g, h)
    return a, b, c, d, e, f, g, h, least


@compiled(seldom=True)
def list_exactly(n: int, places: int, i: int, lane: int, across: int, s: Record) -> None:
    """List the nearest team-mates of the tracker in a lane, in order of exact distances."""
    stride = stride_of(across)
    own_number = natural(i + lane * (1 - across))
    team = natural(lane * across)
    own = team + natural(stride * own_number)
    filled = 0
    for number in range(n):
        at = team + natural(stride * number)
        dx, dy = s.team_x[at] - s.team_x[own], s.team_y[at] - s.team_y[own]
        hc, hs = s.team_cos[own], s.team_sin[own]
        ahead, left = dx * hc + dy * hs, dy * hc - dx * hs
        if number != own_number:
            distance = root(ahead * ahead + left * left)
            filled = keep_nearest(places, filled, number, distance, s)
    for place in range(natural(places)):
        s.listed[WIDTH * place + lane] = s.who[place]


@compiled
def keep_nearest(places: int, filled: int, number: int, distance: np.float32, s: Record) -> int:
    """Insert a team-mate into the list of the nearest, of which ``filled`` are known so far.

    Stable for equal distances. Numbers are in ``who``.
    """
    if filled == places:
        if distance >= s.so_far[places - 1]:
            return filled
        filled -= 1
    spot = filled
    while spot > 0 and s.so_far[spot - 1] > distance:
        s.so_far[spot] = s.so_far[spot - 1]
        s.who[spot] = s.who[spot - 1]
        spot -= 1
    s.so_far[spot] = distance
    s.who[spot] = np.float32(number)
    return filled + 1
