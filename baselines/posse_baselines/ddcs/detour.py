"""Ways past obstacles that stand between a tracker and where it is heading.

The safeguard looks one and a half seconds ahead. In front of a wide obstacle no small change of
direction helps, and it slows down. A detour turns the wanted velocity to the edge of what is in the
way, and keeps to the side that it began with.
"""

from __future__ import annotations

import math
from typing import Final

from posse.numeric import Record, Records, compiled
from posse_baselines.ddcs.memory import Team
from posse_baselines.laws.geometry import length

_SIDE_KEPT: Final = 1.5  # s
_LARGEST: Final = 2.0  # m; reach of a disc; walls are larger
_MOST_TURN: Final = 2.0  # rad; farther round is no way past
_ROUNDS: Final = 6


@compiled
def blocks(disc: Record, clearance: float, ux: float, uy: float) -> bool:
    """Return whether a standing disc lies on the way along a unit vector, nearer than clearance."""
    if disc.speed_x != 0.0 or disc.speed_y != 0.0 or disc.reach > _LARGEST:
        return False
    along, across = disc.x * ux + disc.y * uy, disc.x * uy - disc.y * ux
    # A little less than the tangent's clearance, or the tangent itself would be blocked.
    return bool(along > 0.0 and abs(across) < 0.98 * (disc.reach + clearance))


@compiled
def turn_past(discs: Records, count: int, clearance: float, ux: float, uy: float, side: float) -> float:
    """Return the turn (rad, left positive) to a clear direction on a side (1: left, -1: right).

    ``2 * _MOST_TURN`` if there is none within ``_MOST_TURN``.
    """
    turn, cx, cy = 0.0, ux, uy
    for _ in range(_ROUNDS):
        least, nearest = 1e9, -1
        for k in range(count):
            if blocks(discs[k], clearance, cx, cy):
                distance = length(discs[k].x, discs[k].y)
                if distance < least:
                    least, nearest = distance, k
        if nearest < 0:
            return turn
        disc = discs[nearest]
        half = math.asin(min(1.0, (disc.reach + clearance) / max(least, 1e-6)))
        # From the wanted direction to the disc's centre, then to its edge.
        centre = math.atan2(ux * disc.y - uy * disc.x, ux * disc.x + uy * disc.y)
        turn = centre + side * half
        if abs(turn) > _MOST_TURN:
            return 2.0 * _MOST_TURN
        c, s = math.cos(turn), math.sin(turn)
        cx, cy = ux * c - uy * s, ux * s + uy * c
    return 2.0 * _MOST_TURN


@compiled
def detour(team: Team, me: Record, discs: Records, count: int, vx: float, vy: float) -> tuple[float, float]:
    """Return the wanted velocity (m/s), turned past what stands in its way."""
    world, settings = team.world, team.settings
    speed = length(vx, vy)
    if speed < 1e-6:
        return vx, vy
    ux, uy = vx / speed, vy / speed
    left = turn_past(discs, count, settings.detour, ux, uy, 1.0)
    right = turn_past(discs, count, settings.detour, ux, uy, -1.0)
    if left == 0.0 and right == 0.0:
        return vx, vy
    kept = me.side if (me.step - me.side_step) * world.dt <= _SIDE_KEPT else 0
    goes_left = abs(left) < abs(right)
    if kept != 0 and abs(left if kept > 0 else right) <= _MOST_TURN:
        goes_left = kept > 0
    turn = left if goes_left else right
    if abs(turn) > _MOST_TURN:
        return vx, vy
    me.side, me.side_step = 1 if goes_left else -1, me.step
    c, sine = math.cos(turn), math.sin(turn)
    return vx * c - vy * sine, vx * sine + vy * c
