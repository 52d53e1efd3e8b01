"""Eight observers at once, one per lane: rows of their team.

The eight are one tracker of eight worlds (``across`` is 1) or, with fewer worlds or large teams,
eight trackers of one world (0). A row holds the team twice, so that the offset of a team-mate from
its observer does not wrap around.
"""

from __future__ import annotations

import numpy as np

from posse.numeric import WIDTH, Lanes, Record, Records, choose, compiled, eight, load, load_fields, store, transpose
from posse.rules.discs import columns, natural
from posse.rules.state import POSE, Pose


@compiled
def stride_of(across: int) -> int:
    """Return the stride between trackers in a row of the team."""
    return WIDTH if across else 1


@compiled
def team_columns(tracker: Records, e: int, i: int, across: int, offset: int) -> tuple[Lanes, ...]:
    """Return :func:`posse.rules.discs.columns` of eight trackers of (E, N), from world e's i."""
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
def lay_out_team(tracker: Records, e: int, across: int, s: Record) -> None:
    """Write the rows of the team of world e, or of eight worlds.

    Values read beyond the end of the last block are undefined.
    """
    n, stride = natural(tracker.shape[1]), stride_of(across)
    each = WIDTH // stride
    # Backwards: the padding of the last block is overwritten by the second copy.
    for block in range((n + each - 1) // each - 1, -1, -1):
        i = natural(each * block)
        pose = Pose(*team_columns(tracker, e, i, across, POSE))
        for at in (stride * i, natural(stride * (i + n))):
            store(s.team_x, at, pose.x)
            store(s.team_y, at, pose.y)
            store(s.team_cos, at, pose.heading_cos)
            store(s.team_sin, at, pose.heading_sin)
            store(s.team_speed, at, pose.speed)
            store(s.team_turn_rate, at, pose.turn_rate)


@compiled
def own_numbers(i: int, across: int, s: Record) -> Lanes:
    """Return the numbers of the observers, of which the first is i."""
    return eight(np.float32(i)) if across else load(s.index, i)


@compiled
def round_again(n: int, number: Lanes) -> Lanes:
    """Return numbers modulo the team size n."""
    return choose(number >= np.float32(n), number - np.float32(n), number)


@compiled
def number_behind(n: int, i: int, m: int, across: int, s: Record) -> Lanes:
    """Return the numbers of the team-mates m + 1 places behind their observers."""
    return round_again(n, own_numbers(i, across, s) + np.float32(m + 1))


@compiled
def way_behind(i: int, m: int, across: int, s: Record) -> tuple[Lanes, Lanes]:
    """Return the vectors to the team-mates m + 1 places behind, common frame, m."""
    own = natural(stride_of(across) * i)
    at = own + natural(stride_of(across) * (m + 1))
    return load(s.team_x, at) - load(s.team_x, own), load(s.team_y, at) - load(s.team_y, own)


@compiled
def seen_at(i: int, m: int, across: int, s: Record) -> tuple[Lanes, Lanes]:
    """Return the vectors to the team-mates m + 1 places behind, ahead and to the left, m."""
    own = natural(stride_of(across) * i)
    dx, dy = way_behind(i, m, across, s)
    hc, hs = load(s.team_cos, own), load(s.team_sin, own)
    return dx * hc + dy * hs, dy * hc - dx * hs
