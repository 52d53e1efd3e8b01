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
from posse_baselines.laws.geometry import angle_of, cross, dot, length, vector

_SIDE_KEPT: Final = 1.5  # s
_LARGEST: Final = 2.0  # m; reach of a disc; walls are larger
_MOST_TURN: Final = 2.0  # rad; farther round is no way past
_ROUNDS: Final = 6


@compiled
def blocks(disc: Record, clearance: float, unit: complex) -> bool:
    """Return whether a standing disc lies on the way along a unit vector, nearer than clearance."""
    if disc.velocity != 0j or disc.reach > _LARGEST:
        return False
    # A little less than the tangent's clearance, or the tangent itself would be blocked.
    return dot(disc.place, unit) > 0.0 and abs(cross(disc.place, unit)) < 0.98 * (disc.reach + clearance)


@compiled
def turn_past(discs: Records, clearance: float, wanted: complex, side: float) -> float:
    """Return the turn (rad, left positive) from a unit vector to a clear direction on a side (1: left, -1: right).

    ``2 * _MOST_TURN`` if there is none within ``_MOST_TURN``.
    """
    turn, unit = 0.0, wanted
    for _ in range(_ROUNDS):
        least, nearest = 1e9, -1
        for k in range(len(discs)):
            if blocks(discs[k], clearance, unit):
                distance = length(discs[k].place)
                if distance < least:
                    least, nearest = distance, k
        if nearest < 0:
            return turn
        disc = discs[nearest]
        half = math.asin(min(1.0, (disc.reach + clearance) / max(least, 1e-6)))
        # From the wanted direction to the disc's centre, then to its edge.
        turn = angle_of(disc.place * wanted.conjugate()) + side * half
        if abs(turn) > _MOST_TURN:
            return 2.0 * _MOST_TURN
        unit = wanted * vector(1.0, turn)
    return 2.0 * _MOST_TURN


@compiled
def detour(team: Team, me: Record, discs: Records, wanted: complex) -> complex:
    """Return the wanted velocity (m/s), turned past what stands in its way."""
    speed, clearance = length(wanted), team.settings.detour
    if speed < 1e-6:
        return wanted
    unit = complex(wanted.real / speed, wanted.imag / speed)
    left, right = turn_past(discs, clearance, unit, 1.0), turn_past(discs, clearance, unit, -1.0)
    if left == 0.0 and right == 0.0:
        return wanted
    kept = me.side if (me.step - me.side_step) * team.world.dt <= _SIDE_KEPT else 0
    goes_left = abs(left) < abs(right)
    if kept != 0 and abs(left if kept > 0 else right) <= _MOST_TURN:
        goes_left = kept > 0
    turn = left if goes_left else right
    if abs(turn) > _MOST_TURN:
        return wanted
    me.side, me.side_step = 1 if goes_left else -1, me.step
    return wanted * vector(1.0, turn)
