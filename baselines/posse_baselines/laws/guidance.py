"""Proportional navigation: the geometry of a pair, the guidance law, heading regulation (sections 3.2 and 3.3).

A tracker pursues a target (in a chain of robots, the robot ahead of it). Symbols as in the paper (figure 3), without
the indices i (target) and i+1 (tracker), which are written out:

==========  =====  ============================================================
``r``       m      distance from tracker to target
``sigma``   rad    angle of the line of sight, from the tracker to the target
``theta``   rad    a heading
``delta``   rad    deviation of a heading from the line of sight, ``θ - σ``: (1), (2)
==========  =====  ============================================================

One law, ``θ = K σ + c``, with a tracker's own navigation constant K (0.9 to 1.1; M = K - 1), deviation c and range r_d.
With the pair (σ_d, θ_d), c = θ_d - K σ_d, it is continuous where σ passes ±π::

    θ = θ_d + K wrap(σ - σ_d)

=======================  ============  ========================================================
law                      K             c
=======================  ============  ========================================================
velocity pursuit         1             0 (σ_d = θ_d = 0)
deviated pursuit         1             not 0, constant: ψ - σ_d
PNGL as printed, (5)     its own       0
PNGL that holds a slot   its own       ψ - K σ_d, or the heading of the slot's occupant - K σ_d
=======================  ============  ========================================================

ψ is the heading of the slot frame, σ_d the line of sight from the slot to the target. The heading is regulated first:
one that does not obey the law yet is turned by the shorter turn, at the limit. Then ω = K dσ/dt + dc/dt: (6), (12).
"""

import math
from typing import Any, Final

import numpy as np

from posse.numeric import FloatArray, Record, compiled
from posse_baselines.laws.geometry import angle_of, clip, dot, length, wrap

MIN_COSINE: Final = 0.6
"""With a smaller cosine of its deviation a tracker hardly changes the range."""
_MIN_RANGE: Final = 1e-3  # m; a shorter one counts as this one where it is divided by
_BRAKING: Final = 0.8  # share of the greatest deceleration that a planned turn uses
_STANDSTILL: Final = 1e-3  # m/s

UNLIMITED: Final = 1e4
"""m/s² or rad/s². What stands for no limit."""
BODY: Final[dict[str, Any]] = {
    "heading": np.complex128(0),
    "speed": 0.0,  # m/s
    "omega": 0.0,  # turn rate, rad/s
    "max_speed": 0.0,
    "max_omega": 0.0,
    "acceleration": 0.0,  # greatest change of the speed, m/s²
    "turn_acceleration": 0.0,  # greatest change of the turn rate, rad/s²
    "dt": 0.0,  # control step, s
}
"""A robot's present motion and its limits: fields, with their types, of a record that laws take as ``body``."""


@compiled
def line_of_sight(tracker: complex, target: complex) -> tuple[float, float]:
    """Return the range r (m, >= 0) and the angle σ (rad, (-π, π]) from tracker to target.

    Where the two coincide, σ is 0.
    """
    way = target - tracker
    return math.hypot(way.real, way.imag), wrap(angle_of(way))


@compiled
def bearing_rate(r: float, target: complex, tracker: complex) -> float:
    """Return dσ/dt (rad/s), the turn rate of the line of sight: (4).

    The velocities (m/s) of target and tracker are v e^(iδ), along the line of sight and to its left. Finite at every
    range.
    """
    return (target.imag - tracker.imag) / max(r, _MIN_RANGE)


@compiled
def lawful_heading(sigma: float, navigation_constant: float, wanted_sigma: float, wanted_theta: float) -> float:
    """Return the heading (rad, (-π, π]) that obeys the law, ``K σ + c``: (5).

    c = ``wanted_theta - K wanted_sigma``; both 0 make it the paper's (5).
    """
    return wrap(wanted_theta + navigation_constant * wrap(sigma - wanted_sigma))


@compiled
def lawful_rate(navigation_constant: float, sigma_rate: float, frame_rate: float) -> float:
    """Return the turn rate (rad/s) of the lawful heading, K dσ/dt + dc/dt: (6), (12).

    ``frame_rate`` (rad/s) is dψ/dt where c follows the slot frame, hence dc/dt = (1 - K) dψ/dt; 0 where c is constant.
    """
    return navigation_constant * sigma_rate + (1.0 - navigation_constant) * frame_rate


@compiled
def maintenance_speed(
    target: complex, delta: float, r: float, wanted_range: float, frame_rate: float, range_gain: float, max_speed: float
) -> float:
    """Return the tracker's speed (m/s, [0, max_speed]) that brings the range to the wanted one.

    (13) with a correction of the range error::

        v = (v_i cos(θ_i - σ) + k_r (r - r_d)) / cos(δ)

    so that dr/dt = k_r (r_d - r) wherever no limit is hit; δ is the tracker's deviation (M σ in the paper), ``target``
    the target's velocity, v_i e^(i(θ_i - σ)). ``range_gain`` k_r (1/s) has to stay below 1 / control step. It holds for
    a tracker that moves away from the target too (cos δ < 0). Where cos δ is small, (13) is ill-conditioned: there the
    speed is the part along the heading of the velocity that keeps range and bearing, the bearing turning at
    ``frame_rate`` (rad/s).
    """
    along = target.real + range_gain * (r - wanted_range)
    cosine = math.cos(delta)
    if abs(cosine) >= MIN_COSINE:
        return clip(along / cosine, 0.0, max_speed)
    return clip(along * cosine + (target.imag - r * frame_rate) * math.sin(delta), 0.0, max_speed)


@compiled
def heading_error(body: Record, v: complex) -> float:
    """Return the angle (rad) by which a robot has to turn to head along a vector."""
    return angle_of(v * body.heading.conjugate())


@compiled
def turn_command(body: Record, error: float, time: float) -> float:
    """Return the turn rate (rad/s) that ends a heading error (rad) without overshooting."""
    most = math.sqrt(2.0 * _BRAKING * body.turn_acceleration * abs(error))
    return clip(error / time, -min(most, body.max_omega), min(most, body.max_omega))


@compiled
def regulate(body: Record, velocity: complex, rate: float = 0.0) -> tuple[float, float]:
    """Return the command (V, ω) of a robot that tracks a velocity (m/s) within its limits.

    V is the part of the velocity that lies ahead, and 0 while it points backwards: the robot turns on the spot. A
    velocity near zero keeps the heading. The wanted velocity itself turns at ``rate`` (rad/s). In every quadrant::

        ω = clip(rate + wrap(θ_wanted - θ) / dt, -ω_max, ω_max)
    """
    if length(velocity) < _STANDSTILL:
        return 0.0, 0.0
    omega = turn_command(body, heading_error(body, velocity), body.dt) + rate
    return clip(dot(velocity, body.heading), 0.0, body.max_speed), clip(omega, -body.max_omega, body.max_omega)


@compiled
def write_motion(body: Record, speed: float, omega: float, action: FloatArray) -> None:
    """Write a command as the first two numbers of an action (2 + m,), clipped to [-1, 1]."""
    action[0] = clip(2.0 * speed / body.max_speed - 1.0, -1.0, 1.0)
    action[1] = clip(omega / body.max_omega, -1.0, 1.0)
