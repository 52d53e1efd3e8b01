"""Slots: position, velocity, and the Cartesian law that holds a slot.

A slot is an arm (x, y) from a leader or the target, m, in a frame that turns with it: the slot
frame ψ, or the leader's own heading. In a turning frame each slot moves on its own circle.
"""

from __future__ import annotations

import math
from typing import Final

from posse.numeric import compiled
from posse_baselines.laws.geometry import MIN_RANGE, length

_SLOW: Final = 1e-2  # m/s; below it a slot's direction of motion is undefined


@compiled
def rotate(x: float, y: float, cosine: float, sine: float) -> tuple[float, float]:
    """Return a vector (x, y) of a turned frame in the frame that it is turned in."""
    return x * cosine - y * sine, x * sine + y * cosine


@compiled
def slot_velocity(speed_x: float, speed_y: float, frame_rate: float, arm_x: float, arm_y: float) -> tuple[float, float]:
    """Return the velocity (m/s) of a slot on an arm (m) that turns at ``frame_rate`` (rad/s)."""
    return speed_x - frame_rate * arm_y, speed_y + frame_rate * arm_x


@compiled
def slot_heading(
    speed_x: float, speed_y: float, frame_rate: float, arm_x: float, arm_y: float, resting: float
) -> float:
    """Return the heading (rad) of a robot in its slot: tangent to the slot's path.

    ``resting`` (rad) is the heading where the slot hardly moves.
    """
    x, y = slot_velocity(speed_x, speed_y, frame_rate, arm_x, arm_y)
    return math.atan2(y, x) if length(x, y) > _SLOW else resting


@compiled
def slot_law(
    offset_x: float, offset_y: float, slot_speed_x: float, slot_speed_y: float, gain: float, max_speed: float
) -> tuple[float, float]:
    """Return the tracker's wanted velocity (x, y) in m/s, no faster than ``max_speed``.

    The slot's velocity plus ``gain`` (1/s, below 1 / control step) times the slot's offset from
    the tracker (m). Where that is more than ``max_speed``, the part along the offset is shortened
    until it is not: the tracker moves at full speed on the straight intercept course of a slot of
    constant velocity. A slot faster than the tracker is followed in its own direction.
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
