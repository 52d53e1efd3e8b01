"""Angles, lengths, and the geometry of a pair of robots (section 3.2, figure 3).

A tracker pursues a target (in a chain of robots, the robot ahead of it). Symbols as in the paper,
without the indices i (target) and i+1 (tracker), which are written out:

==========  =====  ============================================================
``r``       m      distance from tracker to target
``sigma``   rad    angle of the line of sight, from the tracker to the target
``theta``   rad    a heading
``delta``   rad    deviation of a heading from the line of sight, ``θ - σ``
==========  =====  ============================================================

Angles are measured from the positive x-axis and wrapped to (-π, π].
"""

from __future__ import annotations

import math
from typing import Final

from posse.numeric import compiled

MIN_RANGE: Final = 1e-3
"""m. A shorter distance counts as this one where a formula divides by it."""

TURN: Final = 2.0 * math.pi


@compiled
def wrap(angle: float) -> float:
    """Return the same direction (rad) as an angle in (-π, π]."""
    return angle - TURN * math.ceil((angle - math.pi) / TURN)


@compiled
def length(x: float, y: float) -> float:
    """Return the length of a vector.

    ``math.hypot`` also handles lengths whose square overflows, and rounds the last bit correctly;
    it is several times slower, and neither is needed here.
    """
    return math.sqrt(x * x + y * y)


@compiled
def clip(value: float, low: float, high: float) -> float:
    """Return ``value`` clipped to [low, high]."""
    return max(low, min(value, high))


@compiled
def line_of_sight(tracker_x: float, tracker_y: float, target_x: float, target_y: float) -> tuple[float, float]:
    """Return the range r (m, >= 0) and the angle σ (rad, (-π, π]) from tracker to target.

    Where the two coincide, σ is 0.
    """
    ahead = target_x - tracker_x
    aside = target_y - tracker_y
    return math.hypot(ahead, aside), wrap(math.atan2(aside, ahead))


@compiled
def deviation(theta: float, sigma: float) -> float:
    """Return δ (rad, (-π, π]), the angle from the line of sight to a heading: (1), (2)."""
    return wrap(theta - sigma)


@compiled
def bearing_rate(
    r: float, target_speed: float, target_delta: float, tracker_speed: float, tracker_delta: float
) -> float:
    """Return dσ/dt (rad/s), the turn rate of the line of sight: (4).

    Finite at every range: one below ``MIN_RANGE`` counts as ``MIN_RANGE``.
    """
    across = target_speed * math.sin(target_delta) - tracker_speed * math.sin(tracker_delta)
    return across / max(r, MIN_RANGE)
