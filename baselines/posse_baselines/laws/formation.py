"""Formation control: by l-φ a follower keeps distance and direction from its leader.

Section 3.4, figure 6; Desai, Ostrowski and Kumar (2001), l-ψ. Symbols, for a follower j on a leader i:

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

Its velocity in the follower's own axes is the complex number v_j + i d ω_j.
"""

import math

from posse.numeric import Record, compiled
from posse_baselines.laws.geometry import angle_of, clip, length, unit


@compiled
def l_phi_velocity(
    now: complex, wanted: complex, leader: complex, frame_rate: float, alpha_1: float, alpha_2: float
) -> complex:
    """Return the velocity (m/s) wanted of a control point that is, and is wanted, at a position (m) from the leader.

    It moves at A along the line of l, and at B to its left; v_j + i d ω_j is that in the follower's own axes::

        A =   α_1 (l_d - l)           + v_i cos(φ)        v_j   = A cos(γ) - B sin(γ)
        B = l α_2 wrap(φ_d - φ)   - v_i sin(φ) + l ω_i    d ω_j = A sin(γ) + B cos(γ)

    With it, l - l_d decays as exp(-α_1 t) and φ - φ_d as exp(-α_2 t). No γ is singular. ``leader`` is its velocity
    (m/s); ``frame_rate`` (rad/s) is ω_i where φ_d is constant in the leader's frame, and dψ/dt where it follows the
    slot frame.
    """
    l, line = length(now), unit(now)  # noqa: E741
    turning = alpha_2 * angle_of(wanted * line.conjugate()) + frame_rate
    return leader + complex(alpha_1 * (length(wanted) - l), l * turning) * line


@compiled
def sampled_rate(alpha: float, dt: float) -> float:
    """Return the gain (1/s) with which an error decays as exp(-α t) under commands held for dt."""
    return (1.0 - math.exp(-alpha * dt)) / dt


@compiled
def held_command(velocity: complex, point_offset: float, dt: float) -> tuple[float, float]:
    """Return (v_j, ω_j) that, held for dt (s), move the control point as its velocity (m/s) asks.

    The robot moves on an arc. It ends with the control point where the velocity takes it in a straight line; as dt
    goes to 0, v_j is its part ahead and ω_j its part to the left by d. The command ignores limits, and may ask for
    reversing: see :func:`limit_command`.
    """
    ahead, left = velocity.real * dt, velocity.imag * dt
    half = math.atan2(0.5 * left, point_offset + 0.5 * ahead)
    c, s = math.cos(half), math.sin(half)
    arc = half / s if abs(s) > 1e-6 else 1.0
    return (ahead * c + left * s) * arc / dt, 2.0 * half / dt


@compiled
def limit_command(body: Record, speed: float, omega: float, point_offset: float) -> tuple[float, float]:
    """Return the command (V, ω) of l-φ control within a robot's limits.

    A command to reverse becomes a turn on the spot, the short way round, towards the velocity wanted of the control
    point: at the rate that moves the control point at the wanted speed, so that it fades out where nothing is wanted.
    """
    if speed < 0.0:
        sideways = math.hypot(speed, omega * point_offset)
        speed, omega = 0.0, math.copysign(sideways / point_offset, omega)
    return min(speed, body.max_speed), clip(omega, -body.max_omega, body.max_omega)
