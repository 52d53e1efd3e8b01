"""Exploration: a robot that looks for the target drives ahead, away from team-mates and from the borders of an area.

The own heading pulls by 1; what pushes is added to it.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from posse.numeric import compiled
from posse_baselines.laws.geometry import length, scaled

_CLOSE: Final = np.float32(0.5)  # m; a nearer team-mate pushes as one at this distance


@compiled
def push_from(mate: complex, strength: float) -> complex:
    """Return the push from a team-mate (m, relative to the robot) at a distance d: ``strength`` (m²) / d²."""
    d: Any = max(length(mate), _CLOSE)
    return scaled(mate, -strength / (d * d * d))


@compiled
def push_inwards(place: complex, start: complex) -> complex:
    """Return the push to the middle along x and y at a place (m) from it, by their distances from the middle (m).

    It is 0 up to ``start``, then 0.5 more a metre, 1 at most.
    """
    x = min(max(0.5 * (abs(place.real) - start.real), 0.0), 1.0)
    y = min(max(0.5 * (abs(place.imag) - start.imag), 0.0), 1.0)
    return complex(-x if place.real > 0.0 else x, -y if place.imag > 0.0 else y)
