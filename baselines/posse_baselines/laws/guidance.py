"""Guidance laws of a pair of robots: how one robot pursues another (section 3.2 and 3.3).

A tracker pursues a target (in a chain of robots, the robot ahead of it). Symbols, as in the paper,
without the indices i (target) and i+1 (tracker), which are written out here:

======================  =====  ==================================================================
``r``                   m      distance from tracker to target
``sigma``               rad    angle of the line of sight, from the tracker to the target
``theta``               rad    a heading
``delta``               rad    deviation of a heading from the line of sight, ``θ - σ``
``navigation_constant``        K of the proportional navigation, 0.9 < K <= 1.1; M = K - 1
======================  =====  ==================================================================

Angles are measured from the positive x-axis and wrapped to (-π, π]. Every function takes and
returns scalars (float32 or float64), is compiled, and runs uncompiled as well.

The three guidance laws are one law here, :func:`intact_law`: the tracker's heading has to be
``K σ + δ``. They differ in K and δ alone:

========================  ==================  ================
law                       K                   δ
========================  ==================  ================
velocity pursuit          1                   0
deviated pursuit          1                   not 0, constant
proportional navigation   1 - 0.1 .. 1 + 0.1  0
========================  ==================  ================
"""

from __future__ import annotations

import math
from typing import Final

from posse.numeric import compiled

CHASE: Final = 0
"""Stage of a pursuit: far from the wanted range, at full speed."""

MAINTENANCE: Final = 1
"""Stage of a pursuit: near the wanted range, at the speed that keeps it."""

MIN_RANGE: Final = 1e-3
"""m. A shorter distance counts as this one where a formula divides by it."""

MIN_COSINE: Final = 0.1
"""A smaller cosine of the tracker's deviation counts as this one where a formula divides by it."""

TURN: Final = 2.0 * math.pi


# --- geometry of a pair --------------------------------------------------------------------------


@compiled
def wrap(angle: float) -> float:
    """Return the same direction (rad) as an angle in (-π, π]."""
    return angle - TURN * math.ceil((angle - math.pi) / TURN)


@compiled
def length(x: float, y: float) -> float:
    """Return the length of a vector.

    ``math.hypot`` takes care of lengths whose square no float holds, and of the last bit: it takes
    several times as long, and no robot needs either.
    """
    return math.sqrt(x * x + y * y)


@compiled
def clip(value: float, low: float, high: float) -> float:
    """Return ``value``, or the end of [low, high] that it lies beyond."""
    return max(low, min(value, high))


@compiled
def line_of_sight(
    tracker_x: float, tracker_y: float, target_x: float, target_y: float
) -> tuple[float, float]:
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
def range_rate(
    target_speed: float, target_delta: float, tracker_speed: float, tracker_delta: float
) -> float:
    """Return dr/dt (m/s), positive while the target draws away: (3)."""
    return target_speed * math.cos(target_delta) - tracker_speed * math.cos(tracker_delta)


@compiled
def bearing_rate(
    r: float,
    target_speed: float,
    target_delta: float,
    tracker_speed: float,
    tracker_delta: float,
) -> float:
    """Return dσ/dt (rad/s), the turn rate of the line of sight: (4).

    Finite at every range: one below ``MIN_RANGE`` counts as ``MIN_RANGE``.
    """
    across = target_speed * math.sin(target_delta) - tracker_speed * math.sin(tracker_delta)
    return across / max(r, MIN_RANGE)


# --- the intact law ------------------------------------------------------------------------------


@compiled
def regulate_heading(
    theta: float, wanted_theta: float, wanted_rate: float, max_omega: float, dt: float
) -> float:
    """Return the turn rate (rad/s, at most ``max_omega`` either way) that reaches a wanted heading.

    The wanted heading itself turns at ``wanted_rate``. The robot turns at its limit, the short way
    round, for as long as it takes; from then on it turns with the wanted heading::

        omega = clip(wanted_rate + wrap(wanted_theta - theta) / dt, -max_omega, max_omega)

    A command held for the control step ``dt`` (s) therefore ends on the wanted heading of that
    moment or short of it, never beyond. At an error of exactly π the robot turns to the left.
    """
    error = wrap(wanted_theta - theta)
    return clip(wanted_rate + error / dt, -max_omega, max_omega)


@compiled
def lawful_heading(sigma: float, navigation_constant: float, delta: float) -> float:
    """Return the heading (rad, (-π, π]) that obeys the law, ``K σ + δ``: (5).

    Said as a deviation from the line of sight, that is ``M σ + δ`` with M = K - 1 (9).
    ``sigma`` is taken in (-π, π], which bounds ``|M σ|`` by 0.1 π. At ``sigma`` = π the
    heading jumps from one side of the line of sight to the other, by 2 π M.
    """
    return wrap(navigation_constant * wrap(sigma) + delta)


@compiled
def intact_law(
    theta: float,
    sigma: float,
    sigma_rate: float,
    navigation_constant: float,
    delta: float,
    max_omega: float,
    dt: float,
) -> float:
    """Return the tracker's turn rate (rad/s) under ``θ = K σ + δ``: (5), (6), (12).

    Intact: it holds for both signs of ``θ - σ`` and in every quadrant. A heading that does
    not obey the law is first regulated, at the limit ``max_omega`` and the short way round; then
    ω = K dσ/dt, the feed-forward of (12). See :func:`regulate_heading`.
    """
    wanted = lawful_heading(sigma, navigation_constant, delta)
    return regulate_heading(theta, wanted, navigation_constant * sigma_rate, max_omega, dt)


@compiled
def velocity_pursuit(
    theta: float, sigma: float, sigma_rate: float, max_omega: float, dt: float
) -> float:
    """Return the turn rate (rad/s) that keeps the velocity on the line of sight: K = 1."""
    return intact_law(theta, sigma, sigma_rate, 1.0, 0.0, max_omega, dt)


@compiled
def deviated_pursuit(
    theta: float, sigma: float, sigma_rate: float, delta: float, max_omega: float, dt: float
) -> float:
    """Return the turn rate (rad/s) that keeps the velocity ``delta`` (rad) off the line of sight.

    The range can close only while ``|δ| < π / 2``; beyond, the tracker flees.
    """
    return intact_law(theta, sigma, sigma_rate, 1.0, delta, max_omega, dt)


@compiled
def proportional_navigation(
    theta: float,
    sigma: float,
    sigma_rate: float,
    navigation_constant: float,
    max_omega: float,
    dt: float,
) -> float:
    """Return the turn rate (rad/s) of the proportional navigation guidance law: (5), (6), (12)."""
    return intact_law(theta, sigma, sigma_rate, navigation_constant, 0.0, max_omega, dt)


# --- the two stages ------------------------------------------------------------------------------


@compiled
def next_stage(
    stage: int, r: float, wanted_range: float, enter_margin: float, leave_margin: float
) -> int:
    """Return the stage of the pursuit, ``CHASE`` or ``MAINTENANCE``, given the present one.

    The chase ends at ``wanted_range + enter_margin`` and begins again beyond ``wanted_range +
    leave_margin`` (m). With ``0 <= enter_margin < leave_margin`` the switch has hysteresis.
    """
    margin = enter_margin if stage == CHASE else leave_margin
    return MAINTENANCE if r <= wanted_range + margin else CHASE


@compiled
def matching_speed(target_speed: float, target_delta: float, tracker_delta: float) -> float:
    """Return the tracker's speed (m/s) at which the range rests, dr/dt = 0: (13).

    ``v cos(θ_i - σ) / cos(M σ)``, with the tracker's deviation for ``M σ``. It is
    negative where the target approaches. A cosine below ``MIN_COSINE`` counts as ``MIN_COSINE``.
    """
    return target_speed * math.cos(target_delta) / max(math.cos(tracker_delta), MIN_COSINE)


@compiled
def maintenance_speed(
    target_speed: float,
    target_delta: float,
    tracker_delta: float,
    r: float,
    wanted_range: float,
    range_gain: float,
    max_speed: float,
) -> float:
    """Return the tracker's speed (m/s, [0, max_speed]) that brings the range to the wanted one.

    (13) with a correction on the range error, so that dr/dt = range_gain (r_d - r) wherever no
    limit is hit. ``range_gain`` is in 1/s, and has to stay below 1 / control step.
    """
    correction = range_gain * (r - wanted_range) / max(math.cos(tracker_delta), MIN_COSINE)
    matching = matching_speed(target_speed, target_delta, tracker_delta)
    return clip(matching + correction, 0.0, max_speed)


@compiled
def pursuit_speed(
    stage: int,
    target_speed: float,
    target_delta: float,
    tracker_delta: float,
    r: float,
    wanted_range: float,
    range_gain: float,
    max_speed: float,
) -> float:
    """Return the tracker's speed (m/s, [0, max_speed]): full in the chase, then maintenance."""
    if stage == CHASE:
        return max_speed
    return maintenance_speed(
        target_speed, target_delta, tracker_delta, r, wanted_range, range_gain, max_speed
    )
