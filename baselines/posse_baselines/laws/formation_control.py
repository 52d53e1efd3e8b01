"""Formation control: how a robot keeps its place relative to leaders, or to the target.

Two families, one for each of the paper's models:

- *centralized* (section 3.4): a follower keeps its place on a leader, with l-φ control, or the
  distances to two leaders, with l-l control (Desai, Ostrowski and Kumar 2001, l-ψ and l-l);
- *distributed* (section 4.2): every tracker keeps its own slot on the target, in polar or in
  Cartesian form.

Symbols of the centralized family, for a follower j on a leader i:

====================  ======  ====================================================================
``l``                 m       distance from the leader's centre to the follower's control point
``phi``               rad     direction of the control point, seen from the leader's heading
``gamma``             rad     ``θ_i + φ - θ_j``: that direction seen from the follower's
                              heading
``point_offset``      m       d > 0: the control point lies so far ahead of the follower's axle
``alpha_1, alpha_2``  1/s     rates at which the errors of l and φ decay; below 1 / control step
====================  ======  ====================================================================

The motion of the control point obeys::

      dl/dt   =  v_j cos(γ) + d ω_j sin(γ) - v_i cos(φ)
    l dφ/dt = -v_j sin(γ) + d ω_j cos(γ) + v_i sin(φ) - l ω_i

Angles are in radians, wrapped to (-π, π]; lengths in metres, speeds in m/s, turn rates in rad/s.
Every function takes and returns scalars (float32 or float64), is compiled, and runs uncompiled too.
"""

from __future__ import annotations

import math

from posse.numeric import compiled
from posse_baselines.laws.guidance import (
    MIN_RANGE,
    clip,
    length,
    line_of_sight,
    regulate_heading,
    wrap,
)

# --- centralized: where the follower is ----------------------------------------------------------


@compiled
def control_point(x: float, y: float, theta: float, point_offset: float) -> tuple[float, float]:
    """Return the follower's control point (m), ``point_offset`` ahead of its axle."""
    return x + point_offset * math.cos(theta), y + point_offset * math.sin(theta)


@compiled
def separation(
    leader_x: float, leader_y: float, leader_theta: float, point_x: float, point_y: float
) -> tuple[float, float]:
    """Return (l, φ) of a control point: its distance and direction, seen from the leader."""
    distance, angle = line_of_sight(leader_x, leader_y, point_x, point_y)
    return distance, wrap(angle - leader_theta)


@compiled
def separation_rates(
    l_now: float,
    phi: float,
    gamma: float,
    leader_speed: float,
    leader_omega: float,
    speed: float,
    omega: float,
    point_offset: float,
) -> tuple[float, float]:
    """Return (dl/dt, dφ/dt) in m/s and rad/s under given speeds and turn rates of both robots."""
    sideways = point_offset * omega
    along = speed * math.cos(gamma) + sideways * math.sin(gamma) - leader_speed * math.cos(phi)
    across = -speed * math.sin(gamma) + sideways * math.cos(gamma) + leader_speed * math.sin(phi)
    return along, across / max(l_now, MIN_RANGE) - leader_omega


@compiled
def slot_heading(
    slot_distance: float, slot_bearing: float, leader_speed: float, leader_omega: float
) -> float:
    """Return the heading (rad, (-π, π]) of a robot in its slot, relative to the leader's.

    A slot fixed to a leader that turns moves on another circle, and its occupant is tangent to
    that. 0 for a leader that goes straight, or does not move at all. The slot's centre lies
    ``slot_distance`` (m) from the leader's, ``slot_bearing`` (rad) off the leader's heading.
    """
    ahead = leader_speed - leader_omega * slot_distance * math.sin(slot_bearing)
    aside = leader_omega * slot_distance * math.cos(slot_bearing)
    return wrap(math.atan2(aside, ahead))


@compiled
def slot_to_control_point(
    slot_distance: float, slot_bearing: float, relative_heading: float, point_offset: float
) -> tuple[float, float]:
    """Return (l_d, φ_d) of the control point of a robot whose centre is in its slot.

    ``relative_heading`` (rad) is the robot's heading in the slot, relative to the leader's: 0, or
    :func:`slot_heading` where the leader turns.
    """
    ahead = slot_distance * math.cos(slot_bearing) + point_offset * math.cos(relative_heading)
    aside = slot_distance * math.sin(slot_bearing) + point_offset * math.sin(relative_heading)
    return line_of_sight(0.0, 0.0, ahead, aside)


@compiled
def control_point_to_slot(
    l_d: float, phi_d: float, relative_heading: float, point_offset: float
) -> tuple[float, float]:
    """Return (distance, bearing) of the centre of a robot whose control point is at (l_d, φ_d).

    The inverse of :func:`slot_to_control_point`.
    """
    return slot_to_control_point(l_d, phi_d, relative_heading, -point_offset)


# --- centralized: l-phi and l-l ------------------------------------------------------------------


@compiled
def l_phi_demand(
    l_now: float,
    phi: float,
    l_d: float,
    phi_d: float,
    leader_speed: float,
    leader_omega: float,
    alpha_1: float,
    alpha_2: float,
) -> tuple[float, float]:
    """Return the wanted velocity (m/s) of the control point: A along the line of l, B across it.

    ::

        A =   α_1 (l_d - l)           + v_i cos(φ)
        B = l α_2 wrap(φ_d - φ)   - v_i sin(φ) + l ω_i

    With it, l - l_d decays as exp(-α_1 t) and φ - φ_d as exp(-α_2 t).
    """
    along = alpha_1 * (l_d - l_now) + leader_speed * math.cos(phi)
    turning = alpha_2 * wrap(phi_d - phi) + leader_omega
    return along, l_now * turning - leader_speed * math.sin(phi)


@compiled
def l_phi_control(
    along: float, across: float, gamma: float, point_offset: float
) -> tuple[float, float]:
    """Return the follower's (v_j, ω_j) that give its control point the wanted velocity.

    ::

        v_j = A cos(γ) - B sin(γ)        d ω_j = A sin(γ) + B cos(γ)

    No γ is singular. ``along`` (A) and ``across`` (B) come from :func:`l_phi_demand`. The
    command knows no limit, and may ask for reversing: see :func:`limit_command`.
    """
    cosine = math.cos(gamma)
    sine = math.sin(gamma)
    return along * cosine - across * sine, (along * sine + across * cosine) / point_offset


@compiled
def l_l_control(
    l_i: float,
    along_i: float,
    across_i: float,
    gamma_i: float,
    l_k: float,
    along_k: float,
    across_k: float,
    gamma_k: float,
    wanted_crossing: float,
    min_crossing_sine: float,
    point_offset: float,
) -> tuple[float, float]:
    """Return the follower's (v_j, ω_j) that keep its distances to two leaders i and k.

    Both dl/dt equations, solved for v_j and d ω_j::

        cos(γ_i) v_j + sin(γ_i) d ω_j = A_i
        cos(γ_k) v_j + sin(γ_k) d ω_j = A_k

    The determinant is sin(γ_k - γ_i), the sine of the angle at which the two lines cross.
    Two distances fit two places, one on each side of the line through the leaders:
    ``wanted_crossing`` (rad), γ_k - γ_i in the wanted place, says which. Where the lines
    are nearly parallel (a sine below ``min_crossing_sine``, in (0, 1)), or the follower is on the
    wrong side, it keeps its place on the nearer leader instead, by l-φ.

    A (``along``) and B (``across``) of each leader come from :func:`l_phi_demand`; B is used by the
    fallback only. Without limits each distance error decays as exp(-α_1 t) otherwise.
    """
    determinant = math.sin(gamma_k - gamma_i)
    side = 1.0 if math.sin(wanted_crossing) >= 0.0 else -1.0
    if side * determinant < min_crossing_sine:
        if l_i <= l_k:
            return l_phi_control(along_i, across_i, gamma_i, point_offset)
        return l_phi_control(along_k, across_k, gamma_k, point_offset)
    speed = (along_i * math.sin(gamma_k) - along_k * math.sin(gamma_i)) / determinant
    sideways = (along_k * math.cos(gamma_i) - along_i * math.cos(gamma_k)) / determinant
    return speed, sideways / point_offset


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


# --- distributed: slots on the target ------------------------------------------------------------


@compiled
def slot_line_of_sight(slot_frame: float, slot_bearing: float) -> float:
    """Return σ_d (rad, (-π, π]), the line of sight from a slot's occupant to the target.

    ``slot_frame`` is the heading ψ of the slot frame; ``slot_bearing`` is the slot's direction
    seen from the target and measured from ψ (π: behind the target).
    """
    return wrap(slot_frame + slot_bearing + math.pi)


@compiled
def polar_slot_velocity(
    r: float,
    sigma: float,
    target_speed: float,
    target_theta: float,
    wanted_range: float,
    wanted_sigma: float,
    slot_frame_rate: float,
    range_gain: float,
    bearing_gain: float,
    max_speed: float,
) -> tuple[float, float]:
    """Return the tracker's wanted speed (m/s, [0, max_speed]) and deviation δ (rad).

    Wanting ::

        dr/dt       = k_r (r_d - r)
        dσ/dt = ω_ψ + k_σ min(1, r_d / r) wrap(σ_d - σ)

    in (3) and (4) gives the tracker's velocity along and across the line of sight, v_p cos(δ)
    and v_p sin(δ). Too high a speed is cut; the deviation stays. ``r`` and ``sigma`` are the
    line of sight to the target, ``wanted_sigma`` that of :func:`slot_line_of_sight`,
    ``slot_frame_rate`` (rad/s) the turn rate ω_ψ of the slot frame. The gains (1/s) have to
    stay below 1 / control step. The wanted heading is ``σ + δ``: see :func:`drive`.
    """
    target_delta = target_theta - sigma
    reach = min(1.0, wanted_range / max(r, MIN_RANGE))
    sigma_rate = slot_frame_rate + bearing_gain * reach * wrap(wanted_sigma - sigma)
    along = target_speed * math.cos(target_delta) - range_gain * (wanted_range - r)
    across = target_speed * math.sin(target_delta) - r * sigma_rate
    return min(math.hypot(along, across), max_speed), wrap(math.atan2(across, along))


@compiled
def slot_motion(
    target_x: float,
    target_y: float,
    target_speed: float,
    target_theta: float,
    slot_frame: float,
    slot_frame_rate: float,
    slot_distance: float,
    slot_bearing: float,
) -> tuple[float, float, float, float]:
    """Return a slot's position (x, y) in m and velocity (x, y) in m/s.

    The slot lies ``slot_distance`` (m) from the target, in the direction ``slot_bearing`` (rad) off
    the slot frame's heading, and turns about the target at ``slot_frame_rate`` (rad/s).
    """
    angle = slot_frame + slot_bearing
    arm_x = slot_distance * math.cos(angle)
    arm_y = slot_distance * math.sin(angle)
    return (
        target_x + arm_x,
        target_y + arm_y,
        target_speed * math.cos(target_theta) - slot_frame_rate * arm_y,
        target_speed * math.sin(target_theta) + slot_frame_rate * arm_x,
    )


@compiled
def cartesian_slot_velocity(
    offset_x: float,
    offset_y: float,
    slot_speed_x: float,
    slot_speed_y: float,
    gain: float,
    max_speed: float,
) -> tuple[float, float]:
    """Return the tracker's wanted speed (m/s, [0, max_speed]) and heading (rad).

    :func:`cartesian_slot_components` as :func:`drive` takes it.
    """
    speed_x, speed_y = cartesian_slot_components(
        offset_x, offset_y, slot_speed_x, slot_speed_y, gain, max_speed
    )
    return min(length(speed_x, speed_y), max_speed), wrap(math.atan2(speed_y, speed_x))


@compiled
def cartesian_slot_components(
    offset_x: float,
    offset_y: float,
    slot_speed_x: float,
    slot_speed_y: float,
    gain: float,
    max_speed: float,
) -> tuple[float, float]:
    """Return the tracker's wanted velocity (x, y) in m/s, no faster than ``max_speed``.

    The slot's velocity plus ``gain`` (1/s, below 1 / control step) times the slot's offset from
    the tracker (m). Where that is more than ``max_speed``, the part along the offset is shortened
    until it is not: the tracker goes at full speed, on the course that meets a slot of constant
    velocity on a straight line. A slot that outruns the tracker is followed in its own direction.
    """
    distance = length(offset_x, offset_y)
    approach = gain * distance
    unit_x = offset_x / max(distance, MIN_RANGE)
    unit_y = offset_y / max(distance, MIN_RANGE)
    opening = slot_speed_x * unit_x + slot_speed_y * unit_y
    surplus = max_speed**2 - slot_speed_x**2 - slot_speed_y**2
    if surplus >= 0.0:
        approach = min(approach, math.sqrt(surplus + opening**2) - opening)
    speed_x = slot_speed_x + approach * unit_x
    speed_y = slot_speed_y + approach * unit_y
    speed = length(speed_x, speed_y)
    if speed <= max_speed:
        return speed_x, speed_y
    return speed_x * (max_speed / speed), speed_y * (max_speed / speed)


@compiled
def drive(
    theta: float,
    wanted_speed: float,
    wanted_theta: float,
    wanted_rate: float,
    max_speed: float,
    max_omega: float,
    dt: float,
) -> tuple[float, float]:
    """Return the command (V, ω) of a robot that takes up a wanted speed (>= 0) and heading.

    The heading is regulated by the intact law, with ``wanted_rate`` (rad/s) as feed-forward. The
    speed is the part of the wanted velocity that lies ahead of the robot: none while that points
    backwards, so that the robot turns round on the spot instead of reversing.
    V in [0, max_speed], ω in [-max_omega, max_omega]; ``dt`` (s) is the control step.
    """
    ahead = wanted_speed * math.cos(wrap(wanted_theta - theta))
    omega = regulate_heading(theta, wanted_theta, wanted_rate, max_omega, dt)
    return clip(ahead, 0.0, max_speed), omega
