"""The proportional navigation guidance law and its special cases (sections 3.2 and 3.3).

One law, ``θ = K σ + c``, with a tracker's own navigation constant K (0.9 to 1.1; M = K - 1),
deviation c and range r_d. With the pair (σ_d, θ_d), c = θ_d - K σ_d, it is continuous where
σ passes ±π::

    θ = θ_d + K wrap(σ - σ_d)

=======================  ============  ========================================================
law                      K             c
=======================  ============  ========================================================
velocity pursuit         1             0 (σ_d = θ_d = 0)
deviated pursuit         1             not 0, constant: ψ - σ_d
PNGL as printed, (5)     its own       0
PNGL that holds a slot   its own       ψ - K σ_d, or the heading of the slot's occupant - K σ_d
=======================  ============  ========================================================

ψ is the heading of the slot frame, σ_d the line of sight from the slot to the target. The heading
is regulated first (:mod:`~posse_baselines.laws.heading`), then ω = K dσ/dt + dc/dt: (6), (12).
"""

from __future__ import annotations

import math
from typing import Final

from posse.numeric import compiled
from posse_baselines.laws.geometry import clip, wrap

MIN_COSINE: Final = 0.6
"""With a smaller cosine of its deviation a tracker hardly changes the range."""


@compiled
def lawful_heading(sigma: float, navigation_constant: float, wanted_sigma: float, wanted_theta: float) -> float:
    """Return the heading (rad, (-π, π]) that obeys the law, ``K σ + c``: (5).

    c = ``wanted_theta - K wanted_sigma``; both 0 make it the paper's (5).
    """
    return wrap(wanted_theta + navigation_constant * wrap(sigma - wanted_sigma))


@compiled
def lawful_rate(navigation_constant: float, sigma_rate: float, frame_rate: float) -> float:
    """Return the turn rate (rad/s) of the lawful heading, K dσ/dt + dc/dt: (6), (12).

    ``frame_rate`` (rad/s) is dψ/dt where c follows the slot frame, hence dc/dt = (1 - K) dψ/dt;
    0 where c is constant.
    """
    return navigation_constant * sigma_rate + (1.0 - navigation_constant) * frame_rate


@compiled
def maintenance_speed(
    target_speed: float,
    target_delta: float,
    tracker_delta: float,
    r: float,
    wanted_range: float,
    frame_rate: float,
    range_gain: float,
    max_speed: float,
) -> float:
    """Return the tracker's speed (m/s, [0, max_speed]) that brings the range to the wanted one.

    (13) with a correction of the range error::

        v = (v_i cos(θ_i - σ) + k_r (r - r_d)) / cos(δ)

    so that dr/dt = k_r (r_d - r) wherever no limit is hit; δ is the tracker's deviation (M σ in the
    paper). ``range_gain`` k_r is in 1/s, and has to stay below 1 / control step. It holds for a
    tracker that moves away from the target too (cos δ < 0), where the target moves towards it.
    Where cos δ is small, (13) is ill-conditioned: there the speed is the part along the heading of
    the velocity that keeps range and bearing, the bearing turning at ``frame_rate`` (rad/s).
    """
    along = target_speed * math.cos(target_delta) + range_gain * (r - wanted_range)
    cosine = math.cos(tracker_delta)
    if abs(cosine) >= MIN_COSINE:
        return clip(along / cosine, 0.0, max_speed)
    across = target_speed * math.sin(target_delta) - r * frame_rate
    return clip(along * cosine + across * math.sin(tracker_delta), 0.0, max_speed)
