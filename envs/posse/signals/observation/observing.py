"""Writes the observations: one robot of eight worlds at once, one world per lane (:mod:`~.views`)."""

from __future__ import annotations

from typing import Final

import numpy as np

from posse.numeric import WIDTH, FloatArray, Record, Records, compiled
from posse.rules.discs import natural
from posse.rules.senses.sonar import ping
from posse.rules.state import WorldArrays
from posse.signals.generate import Generated
from posse.signals.observation.mates import observe_mates
from posse.signals.observation.rows import Observers, Rows
from posse.signals.observation.views import lay_out_observers, view_of_targets, view_of_trackers

TOGETHER: Final = WIDTH
"""Worlds processed together."""

_ZERO: Final = np.float32(0.0)


@compiled
def observe_together(
    c: Record, worlds: WorldArrays, first: int, count: int, made: Generated, s: Record, observations: FloatArray
) -> None:
    """Write the observations of all agents of ``count`` worlds, at most eight, without the sonar."""
    lay_out_observers(c, worlds, first, count, s)
    for i in range(natural(c.num_trackers)):
        observers = Observers(first, i, count)
        view = view_of_trackers(c, worlds, observers, s)
        made.write_own(c, view, s, Rows(observers, observations, 0))
        observe_mates(c, worlds, observers, view, c.perfect_radio != 0, made, s, observations)
    if c.target_agent != 0:
        _observe_targets(c, worlds, Observers(first, c.num_trackers, count), made, s, observations)


@compiled(seldom=True)
def _observe_targets(
    c: Record, worlds: WorldArrays, observers: Observers, made: Generated, s: Record, observations: FloatArray
) -> None:
    """Write what target agents observe: the trackers in the places of team-mates, without error."""
    view = view_of_targets(c, s)
    made.write_own(c, view, s, Rows(observers, observations, 0))
    observe_mates(c, worlds, observers, view, True, made, s, observations)


@compiled
def observe_sonar(c: Record, w: Record, trackers: Records, s: Record, observations: FloatArray, first: int) -> None:
    """Write the sonar of every agent of a world to (rows, F), from ``first`` on.

    Positions of discs are read from ``s`` (:func:`posse.rules.discs.lay_out`).
    """
    n = natural(c.num_trackers)
    for i in range(n):
        t = trackers[i]
        pose = (t.x, t.y, t.heading_cos, t.heading_sin)
        ping(c, pose, i, s.gap[i], s, observations[i], first)
    if c.target_agent != 0:
        ping(c, (w.x, w.y, w.heading_cos, w.heading_sin), n, _ZERO, s, observations[n], first)
