"""l-φ formation control: a follower keeps distance and direction from one leader (figure 6).

Desai, Ostrowski and Kumar (2001), l-ψ. Symbols, for a follower j on a leader i:

====================  ======  ====================================================================
``l``                 m       distance from the leader's centre to the follower's control point
``phi``               rad     direction of the control point, seen from the leader's heading
``gamma``             rad     ``θ_i + φ - θ_j``: that direction seen from the follower's heading
``point_offset``      m       d > 0: the control point c_j lies so far ahead of the follower's axle
``alpha_1, alpha_2``  1/s     rates at which the errors of l and φ decay; below 1 / control step
====================  ======  ====================================================================

The motion of the control point obeys::

      dl/dt   =  v_j cos(γ) + d ω_j sin(γ) - v_i cos(φ)
    l dφ/dt = -v_j sin(γ) + d ω_j cos(γ) + v_i sin(φ) - l ω_i
"""

from __future__ import annotations

import math

from posse.numeric import compiled
from posse_baselines.laws.geometry import clip, wrap


@compiled
def l_phi_demand(
    l_now: float,
    phi: float,
    l_d: float,
    phi_d: float,
    leader_speed: float,
    frame_rate: float,
    alpha_1: float,
    alpha_2: float,
) -> tuple[float, float]:
    """Return the wanted velocity (m/s) of the control point: A along the line of l, B across it.

    ::

        A =   α_1 (l_d - l)           + v_i cos(φ)
        B = l α_2 wrap(φ_d - φ)   - v_i sin(φ) + l ω_i

    With it, l - l_d decays as exp(-α_1 t) and φ - φ_d as exp(-α_2 t). ``frame_rate`` (rad/s) is
    ω_i where φ_d is constant in the leader's frame, and dψ/dt where it follows the slot frame.
    """
    along = alpha_1 * (l_d - l_now) + leader_speed * math.cos(phi)
    turning = alpha_2 * wrap(phi_d - phi) + frame_rate
    return along, l_now * turning - leader_speed * math.sin(phi)


@compiled
def sampled_rate(alpha: float, dt: float) -> float:
    """Return the gain (1/s) with which an error decays as exp(-α t) under commands held for dt."""
    return (1.0 - math.exp(-alpha * dt)) / dt


@compiled
def point_velocity(along: float, across: float, gamma: float) -> tuple[float, float]:
    """Return the wanted velocity (m/s) of the control point ahead of and across the follower.

    ::

        v_j = A cos(γ) - B sin(γ)        d ω_j = A sin(γ) + B cos(γ)

    No γ is singular.
    """
    cosine = math.cos(gamma)
    sine = math.sin(gamma)
    return along * cosine - across * sine, along * sine + across * cosine


@compiled
def held_command(ahead: float, across: float, point_offset: float, dt: float) -> tuple[float, float]:
    """Return (v_j, ω_j) that, held for dt (s), move the control point as its velocity asks.

    The robot moves on an arc. It ends with the control point where (``ahead``, ``across``), m/s,
    takes it in a straight line; as dt goes to 0, v_j = ahead and ω_j = across / d. The command
    ignores limits, and may ask for reversing: see :func:`limit_command`.
    """
    half = math.atan2(0.5 * across * dt, point_offset + 0.5 * ahead * dt)
    c, s = math.cos(half), math.sin(half)
    chord = ahead * dt * c + across * dt * s
    arc = half / s if abs(s) > 1e-6 else 1.0
    return chord * arc / dt, 2.0 * half / dt


@compiled
def limit_command(
    speed: float, omega: float, point_offset: float, max_speed: float, max_omega: float
) -> tuple[float, float]:
    """Return the command (V, ω) of l-φ or l-l control within a robot's limits.

    V in [0, max_speed], ω in [-max_omega, max_omega]. A command to reverse becomes a turn on
    the spot, the short way round, towards the velocity wanted of the control point: at the rate
    that moves the control point at the wanted speed, so that it fades out where nothing is wanted.
    """
    if speed < 0.0:
        sideways = math.hypot(speed, omega * point_offset)
        return 0.0, clip(math.copysign(sideways / point_offset, omega), -max_omega, max_omega)
    return min(speed, max_speed), clip(omega, -max_omega, max_omega)
