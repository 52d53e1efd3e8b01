"""Formation slots around the target, and the slot frame.

A slot is a polar offset (r, β) from the target in the slot frame ψ; β = π is behind the target. The
frame follows the target's heading at a limited rate, so that a robot that does not reverse can
follow every slot (:attr:`posse.scenarios.scenario.Scenario.slot_turn_rate`).
"""

from __future__ import annotations

import math
from typing import Final

FORMATIONS: Final = ("wedge", "ring", "rows")

_DIAGONAL: Final = math.sqrt(0.5)  # the wings of the wedge are at 45 degrees


def slot_offsets(formation: str, number: int, distance: float, spacing: float) -> list[tuple[float, float]]:
    """Return the (x, y) of each slot in the slot frame, m; x points ahead.

    ========== ====================================================================================
    wedge      the first slot straight behind the target, the others alternating on two wings that
               extend backwards at 45 degrees, ``formation_spacing`` apart
    ring       evenly around the target, the first slot behind it; the radius grows with the team so
               that neighbours are ``formation_spacing`` apart, and is at least
               ``formation_distance``
    rows       a block behind the target, as wide as deep, ``formation_spacing`` apart
    ========== ====================================================================================
    """
    if formation == "ring":
        radius = max(distance, spacing / (2 * math.sin(math.pi / number))) if number > 1 else distance
        bearings = [math.pi + 2 * math.pi * i / number for i in range(number)]
        return [(radius * math.cos(b), radius * math.sin(b)) for b in bearings]
    if formation == "rows":
        width = math.ceil(math.sqrt(number))
        rows = [range(start, min(start + width, number)) for start in range(0, number, width)]
        return [
            (-distance - spacing * depth, spacing * (column - (len(row) - 1) / 2))
            for depth, row in enumerate(rows)
            for column in range(len(row))
        ]
    wing = spacing * _DIAGONAL
    return [(-distance - wing * ((i + 1) // 2), wing * ((i + 1) // 2) * (1 if i % 2 else -1)) for i in range(number)]
