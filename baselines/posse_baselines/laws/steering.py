"""Interception of moving points, and approach velocities."""

from __future__ import annotations

import math
from typing import Final

from posse.numeric import FloatArray, compiled
from posse_baselines.laws.geometry import clip, length
from posse_baselines.laws.slots import slot_law, slot_velocity

NEVER: Final = 1e6
"""s. Value for no interception."""

_FARTHEST: Final = 20.0  # s; later interceptions are planned with this time
_SOON: Final = 0.1  # s; before that only the current velocity counts
_LEAST_TURN: Final = 0.6
"""rad. Least angle ahead on the circle for a tracker on or inside it."""
_SPEED_LEFT: Final = 0.8
"""Share of the greatest deceleration that a planned approach uses."""


@compiled
def intercept_time(x: float, y: float, speed_x: float, speed_y: float, max_speed: float) -> float:
    """Return the earliest interception time (s) of a point, straight at ``max_speed``.

    The point is (x, y) away (m) and moves at a constant velocity (m/s): the least root t >= 0 of
    ``|p + s t| = V t``. ``NEVER`` if there is none.
    """
    surplus = max_speed**2 - speed_x**2 - speed_y**2
    opening = x * speed_x + y * speed_y
    square = x * x + y * y
    if surplus <= 1e-9:
        return NEVER if opening >= 0.0 else min(NEVER, -0.5 * square / opening)
    time = (opening + math.sqrt(opening**2 + surplus * square)) / surplus
    return clip(time, 0.0, NEVER)


@compiled
def time_to_slot(
    x: float,
    y: float,
    speed_x: float,
    speed_y: float,
    mean_x: float,
    mean_y: float,
    weave_time: float,
    max_speed: float,
) -> float:
    """Return the intercept time (s) of a slot at (x, y) from the tracker, m.

    The target is assumed to keep its velocity (m/s), or its mean velocity (m/s) if the intercept
    takes longer than ``weave_time`` (s).
    """
    time = intercept_time(x, y, speed_x, speed_y, max_speed)
    if time > weave_time:
        time = intercept_time(x, y, mean_x, mean_y, max_speed)
    return time


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
    """Return the wanted velocity (x, y) in m/s towards a moving slot, limited by braking distance.

    :func:`~posse_baselines.laws.slots.slot_law` with the gain lowered where the tracker, whose
    speed changes by at most ``deceleration`` (m/s²), could not brake in time.
    """
    distance = length(offset_x, offset_y)
    if distance > 1e-6:
        gain = min(gain, math.sqrt(2.0 * _SPEED_LEFT * deceleration / distance))
    return slot_law(offset_x, offset_y, slot_speed_x, slot_speed_y, gain, max_speed)


@compiled
def way_round(from_x: float, from_y: float, to_x: float, to_y: float, clearance: float) -> tuple[float, float]:
    """Return the next waypoint from one position to another around the origin (m).

    The goal itself if the straight path keeps ``clearance`` from the origin; else the tangent point
    on that circle, on the shorter side. A tracker on the circle heads for a point a little further
    along it, and comes no nearer than 0.82 of the clearance.
    """
    way_x, way_y = to_x - from_x, to_y - from_y
    square = way_x * way_x + way_y * way_y
    along = -(from_x * way_x + from_y * way_y)
    if along <= 0.0 or along >= square:
        return to_x, to_y
    crossing = from_x * way_y - from_y * way_x
    if crossing * crossing >= clearance * clearance * square:
        return to_x, to_y
    distance = length(from_x, from_y)
    angle = math.acos(min(1.0, clearance / max(distance, 1e-6)))
    angle = max(angle, _LEAST_TURN)
    if crossing < 0.0:
        angle = -angle
    c, s = math.cos(angle), math.sin(angle)
    scale = clearance / max(distance, 1e-6)
    return (from_x * c - from_y * s) * scale, (from_x * s + from_y * c) * scale


@compiled
def meeting_velocity(
    from_x: float,
    from_y: float,
    arm_x: float,
    arm_y: float,
    speed_x: float,
    speed_y: float,
    mean_x: float,
    mean_y: float,
    frame_rate: float,
    weave_time: float,
    clearance: float,
    gain: float,
    max_speed: float,
    deceleration: float,
) -> tuple[float, float]:
    """Return the velocity (x, y) in m/s of an intercept course to a slot, around the target.

    Tracker (``from``) and slot (``arm``) are relative to the target, m. Far slots are predicted
    with the target's mean velocity (``mean``), near ones with its current one, which is used for
    about ``weave_time`` (s). ``frame_rate`` (rad/s) is that of the slot frame.
    """
    round_x, round_y = way_round(from_x, from_y, arm_x, arm_y, clearance)
    dx, dy = round_x - from_x, round_y - from_y
    time = min(intercept_time(dx, dy, speed_x, speed_y, max_speed), _FARTHEST)
    ahead = 1.0
    if time > _SOON:
        ahead = weave_time * (1.0 - math.exp(-time / weave_time)) / time
    slot_x, slot_y = slot_velocity(speed_x, speed_y, frame_rate, arm_x, arm_y)
    sx = ahead * slot_x + (1.0 - ahead) * mean_x
    sy = ahead * slot_y + (1.0 - ahead) * mean_y
    return approach_velocity(dx, dy, sx, sy, gain, max_speed, deceleration)


@compiled
def write_motion(action: FloatArray, speed: float, omega: float, max_speed: float, max_omega: float) -> None:
    """Write the first two numbers of an action (2 + m,), clipped to [-1, 1]."""
    action[0] = clip(2.0 * speed / max_speed - 1.0, -1.0, 1.0)
    action[1] = clip(omega / max_omega, -1.0, 1.0)
