"""The tracking layer: the law of the current task.

A law returns (vx, vy, V, ω): the velocity (m/s, common frame) for the safeguard, and the command
to execute if the safeguard accepts it.
"""

from __future__ import annotations

import math
from typing import Final

from posse.numeric import Record, Records, compiled
from posse_baselines.ddcs.memory import CONVERGING, EXCHANGING, FLOCKING
from posse_baselines.ddcs.monitoring import is_there
from posse_baselines.ddcs.tracking.following import on_leader, place_on_leader
from posse_baselines.ddcs.tracking.slots import slot_place
from posse_baselines.laws.geometry import bearing_rate, clip, deviation, length, line_of_sight
from posse_baselines.laws.guidance import MIN_COSINE, lawful_heading, lawful_rate, maintenance_speed
from posse_baselines.laws.heading import regulate
from posse_baselines.laws.slots import slot_heading
from posse_baselines.laws.steering import approach_velocity, meeting_velocity

CENTRALIZED: Final = 1
PNGL: Final = 1
NO_DEVIATION: Final = 0
OF_OCCUPANT: Final = 2

_FULL_SPEED: Final = 1e6  # 1/s; a gain that saturates the speed at any distance
_FAR_SIGHT: Final = 8.0  # m; with a longer sensing range no motion is needed
_MOST_DEVIATION: Final = 0.7  # rad; beyond, a chase hardly closes in

Motion = tuple[float, float, float, float]


@compiled
def take_up(body: Record, vx: float, vy: float, rate: float) -> Motion:
    """Return a wanted velocity (m/s) that turns at ``rate`` (rad/s), with its command."""
    speed, omega = regulate(body, vx, vy, rate)
    return vx, vy, speed, omega


@compiled
def hunt(s: Record, d: Record, n: int, x: float, y: float, body: Record) -> Motion:
    """Return the motion to see a lost target again.

    The team spreads on a ring around its predicted position, slot by slot on either side of its
    heading; the ring grows with the time that it was not seen.
    """
    side = 1.0 if d.slot % 2 else -1.0
    angle = d.now_theta + side * ((d.slot + 1) // 2) * 2.0 * math.pi / n
    away = s.hunt_growth * d.age
    dx = d.now_x + away * math.cos(angle) - x
    dy = d.now_y + away * math.sin(angle) - y
    distance = length(dx, dy)
    speed = min(body.max_speed, s.gain * distance)
    scale = speed / max(distance, 1e-6)
    return take_up(body, scale * dx, scale * dy, 0.0)


@compiled
def to_slot(s: Record, d: Record, slots: Records, x: float, y: float, body: Record) -> Motion:
    """Return the motion that takes up the slot on the target (converging) or keeps it (flocking).

    Converging: intercept at full speed, around the target; flocking: the slot law.
    """
    _, _, arm_x, arm_y = slot_place(d, slots[d.slot])
    arm_x, arm_y = arm_x + s.aim_ahead * d.frame_cos, arm_y + s.aim_ahead * d.frame_sin
    gain, clearance, rate = s.gain, 0.0, s.feed_forward * d.psi_rate
    if d.task == CONVERGING:
        gain, clearance, rate = _FULL_SPEED, s.clearance, 0.0
    vx, vy = meeting_velocity(
        x - d.now_x,
        y - d.now_y,
        arm_x,
        arm_y,
        d.speed_x,
        d.speed_y,
        d.mean_x,
        d.mean_y,
        d.psi_rate,
        s.weave_time,
        clearance,
        gain,
        body.max_speed,
        body.acceleration,
    )
    return take_up(body, vx, vy, rate)


@compiled
def pursue(s: Record, d: Record, constant: float, slot: Record, x: float, y: float, body: Record) -> Motion:
    """Return the motion of PNGL with constant K: θ = K σ + c, ω = K dσ/dt + dc/dt.

    Converging is the chase at full speed, flocking the speed of (13) with a correction of the
    range. The wanted range is the slot's distance from the target.
    """
    _, _, arm_x, arm_y = slot_place(d, slot)
    r, sigma = line_of_sight(x, y, d.now_x, d.now_y)
    wanted_sigma, wanted_theta, frame_rate = 0.0, 0.0, 0.0
    if s.deviation != NO_DEVIATION:
        wanted_sigma = math.atan2(-arm_y, -arm_x)
        wanted_theta = math.atan2(d.frame_sin, d.frame_cos)
        frame_rate = d.psi_rate
    if s.deviation == OF_OCCUPANT:
        wanted_theta = slot_heading(d.speed_x, d.speed_y, d.psi_rate, arm_x, arm_y, wanted_theta)
    if s.deviation != NO_DEVIATION and d.task == FLOCKING:
        # Feedback on the bearing, c = ... + G wrap(σ - σ_d), acts as a greater K does.
        constant += s.bearing_gain
    if s.deviation == OF_OCCUPANT and d.task == FLOCKING:
        # In front of the target, heading away from it, the bearing turns the other way.
        constant *= clip(math.cos(wanted_theta - wanted_sigma) / MIN_COSINE, -1.0, 1.0)
    theta = lawful_heading(sigma, constant, wanted_sigma, wanted_theta)
    delta = deviation(theta, sigma)
    target_delta = deviation(d.now_theta, sigma)
    if d.task == FLOCKING:
        speed = maintenance_speed(
            d.speed, target_delta, delta, r, length(arm_x, arm_y), frame_rate, s.range_gain, body.max_speed
        )
    else:
        # A chase has to close in, whichever side of the target its slot is on.
        speed = float(body.max_speed)
        delta = clip(delta, -_MOST_DEVIATION, _MOST_DEVIATION)
    theta = sigma + delta
    sigma_rate = bearing_rate(r, d.speed, target_delta, speed, delta)
    d.closing = 1 if d.task == CONVERGING else 0
    return take_up(
        body, speed * math.cos(theta), speed * math.sin(theta), lawful_rate(constant, sigma_rate, frame_rate)
    )


@compiled
def own_constant(s: Record, own: int, n: int) -> float:
    """Return K of a tracker: its own in the distributed model, the leader's in the centralized."""
    if s.model == CENTRALIZED or n == 1:
        return float(s.navigation_constant)
    return float(s.navigation_constant + s.spread * (2.0 * own / (n - 1) - 1.0))


@compiled
def follows(f: Record, s: Record, d: Record, mates: Records, own: int) -> bool:
    """Return whether a tracker follows the leader, not the target."""
    if s.model != CENTRALIZED or d.leader < 0 or d.leader == own:
        return False
    leader = mates[d.leader]
    # A silent leader that cannot be replaced is followed at its last known position.
    tied = (int(s.forbidden) >> (4 * FLOCKING + EXCHANGING)) & 1 != 0 and leader.step >= 0
    return is_there(f, s, d, leader, len(mates)) or tied


@compiled
def note_error(f: Record, s: Record, d: Record, mates: Records, slots: Records, own: int, x: float, y: float) -> None:
    """Store the distance of a tracker from its place, m."""
    d.pursues = 0
    if follows(f, s, d, mates, own):
        place_x, place_y, _, _ = place_on_leader(f, s, d, mates[d.leader], slots[d.slot], slots[0])
    else:
        place_x, place_y, arm_x, arm_y = slot_place(d, slots[d.slot])
        if s.guidance == PNGL:
            d.pursues = 1
            r = length(d.now_x - x, d.now_y - y)
            d.error = max(0.0, r - length(arm_x, arm_y))
            return
    d.error = length(place_x - x, place_y - y)


@compiled
def wanted_motion(
    f: Record, s: Record, d: Record, mates: Records, slots: Records, own: int, x: float, y: float, body: Record
) -> Motion:
    """Return the motion of a tracker that is not searching."""
    n = len(slots)
    if d.task == EXCHANGING:
        return take_up(body, d.speed_x, d.speed_y, d.turn)
    if d.age > d.usual_age + s.close_in_after and f.sight < _FAR_SIGHT:
        return hunt(s, d, n, x, y, body)
    if follows(f, s, d, mates, own):
        if d.task == FLOCKING:
            return on_leader(f, s, d, mates, slots, own, x, y, body)
        place_x, place_y, vx, vy = place_on_leader(f, s, d, mates[d.leader], slots[d.slot], slots[0])
        vx, vy = approach_velocity(place_x - x, place_y - y, vx, vy, _FULL_SPEED, body.max_speed, body.acceleration)
        return take_up(body, vx, vy, 0.0)
    if s.guidance == PNGL:
        return pursue(s, d, own_constant(s, own, n), slots[d.slot], x, y, body)
    return to_slot(s, d, slots, x, y, body)
