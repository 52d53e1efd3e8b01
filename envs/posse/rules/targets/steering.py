"""Steering of a scripted target: turns to its goal heading within its turn limit.

In an arena, turns that lead into a wall or an obstacle are avoided
(:mod:`posse.rules.targets.walls`).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from posse.numeric import Record, Records, compiled
from posse.rules.kinematics import turn_towards
from posse.rules.targets.walls import mirror_at_walls, safe_turn


@compiled
def target_turn_rate(
    c: Record, w: Record, trackers: Records, obstacles: Records, set_goal: Any, s: Record
) -> np.float32:
    """Return the turn rate of a scripted target for the next control step, rad/s."""
    set_goal(c, w, trackers, obstacles, s)
    if c.mirrored:
        mirror_at_walls(c, w)
    turn = turn_towards(w.heading_cos, w.heading_sin, w.goal_cos, w.goal_sin, c.target_turn_rate, c.dt)
    if c.walled:
        turn = safe_turn(c, w, obstacles, turn)
    return turn
