"""Writes the observations.

Eight trackers at once, one per lane (:mod:`~.views`): one tracker of eight worlds
(``across`` is 1) or, with fewer worlds or a large team, eight trackers of one world (0). The sonar
and the target agent are processed world by world.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posse.numeric import WIDTH, FloatArray, Record, Records, compiled
from posse.rules.discs import natural
from posse.rules.senses.sonar import ping
from posse.rules.state import WorldArrays
from posse.signals.generate import Generated
from posse.signals.observation.mates import observe_mates, observe_trackers
from posse.signals.observation.rows import Observers, Rows
from posse.signals.observation.views import lay_out_observers, view_of_target, view_of_trackers
from posse.signals.scratch import MOST_IN_TEAM

TOGETHER: Final = WIDTH
"""Worlds processed together."""

_ZERO: Final = np.float32(0.0)


@compiled
def _observe_some(
    c: Record,
    worlds: WorldArrays,
    e: int,
    i: int,
    count: int,
    across: int,
    made: Generated,
    s: Record,
    observations: FloatArray,
) -> None:
    """Write what ``count`` trackers, the first of them i of world e, observe, the sonar apart."""
    observers = Observers(e, i, count, across)
    view = view_of_trackers(c, worlds, observers, s)
    made.write_own(c, view, Rows(observers, observations, 0, s.start, False))
    k = made.width + natural(c.sonar_beams)
    observe_mates(c, worlds, observers, view, made, s, observations, k)


@compiled
def observe_together(
    c: Record, worlds: WorldArrays, first: int, count: int, made: Generated, s: Record, observations: FloatArray
) -> None:
    """Write the observations of ``count`` worlds, at most eight, without the sonar."""
    n = natural(c.num_trackers)
    if count == TOGETHER and n <= MOST_IN_TEAM:
        lay_out_observers(worlds, first, 1, s)
        for i in range(n):
            _observe_some(c, worlds, first, i, WIDTH, 1, made, s, observations)
        return
    for e in range(first, first + count):
        lay_out_observers(worlds, e, 0, s)
        for i in range(0, n, WIDTH):
            _observe_some(c, worlds, e, i, min(WIDTH, n - i), 0, made, s, observations)


@compiled
def observe_sonar(c: Record, trackers: Records, s: Record, observations: FloatArray, first: int) -> None:
    """Write the sonar of every tracker of a world to (rows, F), from ``first`` on.

    Positions of discs are read from ``s`` (:func:`posse.rules.discs.lay_out`).
    """
    for i in range(natural(c.num_trackers)):
        t = trackers[i]
        pose = (t.x, t.y, t.heading_cos, t.heading_sin)
        ping(c, pose, i, s.gap[i], s, observations[i], first)


@compiled(seldom=True)
def observe_target(
    c: Record, worlds: WorldArrays, e: int, made: Generated, s: Record, observations: FloatArray
) -> None:
    """Write the observation of a target agent, which observes the trackers without error."""
    w, n = worlds.world[e], natural(c.num_trackers)
    view = view_of_target(c, w, worlds.obstacle[e])
    made.write_own(c, view, Rows(Observers(e, n, 1, 0), observations, 0, s.start, False))
    pose = (w.x, w.y, w.heading_cos, w.heading_sin)
    ping(c, pose, n, _ZERO, s, observations[e, n], made.width)
    k = made.width + natural(c.sonar_beams)
    observe_trackers(c, worlds, e, view, made, s, observations, k)
