"""From where a tracker wants to go to what it does: intercept times, braking, turning within limits."""

from __future__ import annotations

import math
from typing import Final

from posse.arrays import FloatArray
from posse.compiled import compiled
from posse_baselines.formation_control import cartesian_slot_velocity
from posse_baselines.guidance import clip, regulate_heading, wrap

NEVER: Final = 1e6
"""s. What stands for a meeting that does not happen."""

_SPEED_LEFT: Final = 0.8
"""Share of the greatest deceleration that a planned approach uses."""


@compiled
def intercept_time(x: float, y: float, speed_x: float, speed_y: float, max_speed: float) -> float:
    """Return the earliest time (s) at which a point can be met, straight on at ``max_speed``.

    The point is (x, y) away (m) and moves at a constant velocity (m/s): the least root t >= 0 of
    ``|p + s t| = V t``. ``NEVER`` for a point that gets away.
    """
    surplus = max_speed**2 - speed_x**2 - speed_y**2
    opening = x * speed_x + y * speed_y
    square = x * x + y * y
    if surplus <= 1e-9:
        return NEVER if opening >= 0.0 else min(NEVER, -0.5 * square / opening)
    return min(NEVER, (opening + math.sqrt(opening**2 + surplus * square)) / surplus)


@compiled
def approach_velocity(
    offset_x: float,
    offset_y: float,
    slot_speed_x: float,
    slot_speed_y: float,
    gain: float,
    max_speed: float,
    deceleration: float,
) -> tuple[float, float]:
    """Return the wanted speed (m/s) and heading (rad) towards a moving slot, with room to brake.

    :func:`~posse_baselines.formation_control.cartesian_slot_velocity` with the gain lowered where
    the tracker, whose speed changes by at most ``deceleration`` (m/s²), could not brake in time.
    """
    distance = math.hypot(offset_x, offset_y)
    if distance > 1e-6:
        gain = min(gain, math.sqrt(2.0 * _SPEED_LEFT * deceleration / distance))
    return cartesian_slot_velocity(
        offset_x, offset_y, slot_speed_x, slot_speed_y, gain, max_speed
    )


@compiled
def follow_velocity(
    theta: float,
    speed_x: float,
    speed_y: float,
    wanted_rate: float,
    max_speed: float,
    max_omega: float,
    turn_acceleration: float,
    dt: float,
) -> tuple[float, float]:
    """Return the command (V, ω) of a robot that takes up a wanted velocity (m/s).

    The intact law steers; a robot whose turn rate changes by at most ``turn_acceleration``
    (rad/s²) slows its turn in time. V is the part of the velocity that lies ahead, and 0 while it
    points backwards. A velocity of nearly nothing keeps the heading.
    """
    speed = math.hypot(speed_x, speed_y)
    if speed < 1e-3:
        return 0.0, 0.0
    heading = math.atan2(speed_y, speed_x)
    error = wrap(heading - theta)
    most = min(max_omega, math.sqrt(2.0 * _SPEED_LEFT * turn_acceleration * abs(error)))
    # While the robot barely moves, the direction of its wanted velocity is mostly noise.
    most = max(most, abs(wanted_rate))
    omega = regulate_heading(theta, heading, wanted_rate, min(most, max_omega), dt)
    return clip(speed * math.cos(error), 0.0, max_speed), omega


@compiled
def write_motion(
    action: FloatArray, speed: float, omega: float, max_speed: float, max_omega: float
) -> None:
    """Write the first two numbers of an action (2 + m,), brought into [-1, 1]."""
    action[0] = clip(2.0 * speed / max_speed - 1.0, -1.0, 1.0)
    action[1] = clip(omega / max_omega, -1.0, 1.0)
