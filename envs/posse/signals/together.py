"""What trackers observe of themselves, their target and their team: eight at once, a lane each.

The eight are one tracker of eight worlds (``across`` is 1) or, where there are fewer worlds or the
team is large, the trackers of one (0).
"""

from __future__ import annotations

from typing import Final

from posse.numeric import WIDTH, FloatArray, Record, compiled
from posse.rules.discs import natural
from posse.rules.state import WorldArrays
from posse.signals.columns import write_rows
from posse.signals.mates import observe_mates
from posse.signals.parts import Writers
from posse.signals.scratch import MOST_IN_TEAM
from posse.signals.team import lay_out_team
from posse.signals.views import view_of_trackers

TOGETHER: Final = WIDTH
"""Worlds that are observed together."""


@compiled
def _observe_some(
    c: Record,
    worlds: WorldArrays,
    e: int,
    i: int,
    count: int,
    across: int,
    writers: Writers,
    s: Record,
    observations: FloatArray,
) -> None:
    """Write what ``count`` trackers, the first of them i of world e, observe together."""
    view = view_of_trackers(c, worlds, e, i, count, across, s)
    writers.own(c, view, s.columns)
    write_rows(s.columns, writers.width, e, i, count, across, observations, 0)
    if observes_mates(c):
        k = writers.width + natural(c.sonar_beams)
        observe_mates(c, worlds.tracker, e, i, count, across, worlds.message, s, observations, k)


@compiled
def observes_mates(c: Record) -> bool:
    """Say whether trackers observe where team-mates are now, not what they last heard of them."""
    return bool(c.perfect_radio != 0 and c.neighbours > 0)


@compiled
def observe_together(
    c: Record,
    worlds: WorldArrays,
    first: int,
    count: int,
    writers: Writers,
    s: Record,
    observations: FloatArray,
) -> None:
    """Write what trackers of ``count`` worlds, at most eight, observe together."""
    n = natural(c.num_trackers)
    if count == TOGETHER and n <= MOST_IN_TEAM:
        if observes_mates(c):
            lay_out_team(worlds.tracker, first, 1, s)
        for i in range(n):
            _observe_some(c, worlds, first, i, WIDTH, 1, writers, s, observations)
        return
    for e in range(first, first + count):
        if observes_mates(c):
            lay_out_team(worlds.tracker, e, 0, s)
        for i in range(0, n, WIDTH):
            _observe_some(c, worlds, e, i, min(WIDTH, n - i), 0, writers, s, observations)
