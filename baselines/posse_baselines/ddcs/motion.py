"""The tracking layer: the law of the current task.

A law returns (vx, vy, V, ω): the velocity (m/s, common frame) for the safeguard, and the command
to execute if the safeguard accepts it.
"""

from __future__ import annotations

import math
from typing import Final

from posse.numeric import Record, Records, compiled
from posse_baselines.ddcs.following import on_leader, place_on_leader
from posse_baselines.ddcs.memory import Team
from posse_baselines.ddcs.monitoring import is_there
from posse_baselines.ddcs.settings import CENTRALIZED, CONVERGING, EXCHANGING, FLOCKING, NO_DEVIATION, OF_OCCUPANT, PNGL
from posse_baselines.ddcs.slots import slot_place
from posse_baselines.laws.geometry import bearing_rate, clip, deviation, length, line_of_sight
from posse_baselines.laws.guidance import MIN_COSINE, lawful_heading, lawful_rate, maintenance_speed
from posse_baselines.laws.heading import regulate
from posse_baselines.laws.slots import slot_heading
from posse_baselines.laws.steering import approach_velocity, meeting_velocity

_FULL_SPEED: Final = 1e6  # 1/s; a gain that saturates the speed at any distance
_FAR_SIGHT: Final = 8.0  # m; with a longer sensing range no motion is needed
_MOST_DEVIATION: Final = 0.7  # rad; beyond, a chase hardly closes in

Motion = tuple[float, float, float, float]


@compiled
def command(me: Record, vx: float, vy: float, rate: float) -> Motion:
    """Return a wanted velocity (m/s) that turns at ``rate`` (rad/s), with its command."""
    speed, omega = regulate(me, vx, vy, rate)
    return vx, vy, speed, omega


@compiled
def hunt(team: Team, me: Record) -> Motion:
    """Return the motion to see a lost target again.

    The team spreads on a ring around its predicted position, slot by slot on either side of its
    heading; the ring grows with the time that it was not seen.
    """
    settings = team.settings
    side = 1.0 if me.slot % 2 else -1.0
    angle = me.target_theta + side * ((me.slot + 1) // 2) * 2.0 * math.pi / len(team.slots)
    away = settings.hunt_growth * me.fix_age
    dx = me.target_x + away * math.cos(angle) - me.x
    dy = me.target_y + away * math.sin(angle) - me.y
    distance = length(dx, dy)
    speed = min(me.max_speed, settings.gain * distance)
    scale = speed / max(distance, 1e-6)
    return command(me, scale * dx, scale * dy, 0.0)


@compiled
def to_slot(team: Team, me: Record) -> Motion:
    """Return the motion that takes up the slot on the target (converging) or keeps it (flocking).

    Converging: intercept at full speed, around the target; flocking: the slot law.
    """
    settings = team.settings
    _, _, arm_x, arm_y = slot_place(me, team.slots[me.slot])
    arm_x, arm_y = arm_x + settings.aim_ahead * me.frame_cos, arm_y + settings.aim_ahead * me.frame_sin
    gain, clearance, rate = settings.gain, 0.0, settings.feed_forward * me.psi_rate
    if me.task == CONVERGING:
        gain, clearance, rate = _FULL_SPEED, settings.clearance, 0.0
    vx, vy = meeting_velocity(
        me.x - me.target_x,
        me.y - me.target_y,
        arm_x,
        arm_y,
        me.target_vx,
        me.target_vy,
        me.mean_vx,
        me.mean_vy,
        me.psi_rate,
        settings.weave_time,
        clearance,
        gain,
        me.max_speed,
        me.acceleration,
    )
    return command(me, vx, vy, rate)


@compiled
def pursue(team: Team, me: Record) -> Motion:
    """Return the motion of PNGL: θ = K σ + c, ω = K dσ/dt + dc/dt.

    Converging is the chase at full speed, flocking the speed of (13) with a correction of the
    range. The wanted range is the slot's distance from the target.
    """
    settings = team.settings
    constant = own_constant(team, me)
    _, _, arm_x, arm_y = slot_place(me, team.slots[me.slot])
    r, sigma = line_of_sight(me.x, me.y, me.target_x, me.target_y)
    wanted_sigma, wanted_theta, frame_rate = 0.0, 0.0, 0.0
    if settings.deviation != NO_DEVIATION:
        wanted_sigma = math.atan2(-arm_y, -arm_x)
        wanted_theta = math.atan2(me.frame_sin, me.frame_cos)
        frame_rate = me.psi_rate
    if settings.deviation == OF_OCCUPANT:
        wanted_theta = slot_heading(me.target_vx, me.target_vy, me.psi_rate, arm_x, arm_y, wanted_theta)
    if settings.deviation != NO_DEVIATION and me.task == FLOCKING:
        # Feedback on the bearing, c = ... + G wrap(σ - σ_d), acts as a greater K does.
        constant += settings.bearing_gain
    if settings.deviation == OF_OCCUPANT and me.task == FLOCKING:
        # In front of the target, heading away from it, the bearing turns the other way.
        constant *= clip(math.cos(wanted_theta - wanted_sigma) / MIN_COSINE, -1.0, 1.0)
    theta = lawful_heading(sigma, constant, wanted_sigma, wanted_theta)
    delta = deviation(theta, sigma)
    target_delta = deviation(me.target_theta, sigma)
    if me.task == FLOCKING:
        speed = maintenance_speed(
            me.target_speed, target_delta, delta, r, length(arm_x, arm_y), frame_rate, settings.range_gain, me.max_speed
        )
    else:
        # A chase has to close in, whichever side of the target its slot is on.
        speed = float(me.max_speed)
        delta = clip(delta, -_MOST_DEVIATION, _MOST_DEVIATION)
    theta = sigma + delta
    sigma_rate = bearing_rate(r, me.target_speed, target_delta, speed, delta)
    me.closing = 1 if me.task == CONVERGING else 0
    return command(me, speed * math.cos(theta), speed * math.sin(theta), lawful_rate(constant, sigma_rate, frame_rate))


@compiled
def own_constant(team: Team, me: Record) -> float:
    """Return K of a tracker: its own in the distributed model, the leader's in the centralized."""
    settings = team.settings
    if settings.model == CENTRALIZED or len(team.slots) == 1:
        return float(settings.navigation_constant)
    return float(settings.navigation_constant + settings.spread * (2.0 * me.number / (len(team.slots) - 1) - 1.0))


@compiled
def follows(team: Team, me: Record, mates: Records) -> bool:
    """Return whether a tracker follows the leader, not the target."""
    settings = team.settings
    if settings.model != CENTRALIZED or me.leader < 0 or me.leader == me.number:
        return False
    leader = mates[me.leader]
    # A silent leader that cannot be replaced is followed at its last known position.
    tied = (int(settings.forbidden) >> (4 * FLOCKING + EXCHANGING)) & 1 != 0 and leader.step >= 0
    return is_there(team, me, leader) or tied


@compiled
def update_error(team: Team, me: Record, mates: Records) -> None:
    """Store the distance of a tracker from its place, m."""
    settings = team.settings
    me.pursues = 0
    if follows(team, me, mates):
        place_x, place_y, _, _ = place_on_leader(team, me, mates[me.leader], team.slots[me.slot], team.slots[0])
    else:
        place_x, place_y, arm_x, arm_y = slot_place(me, team.slots[me.slot])
        if settings.guidance == PNGL:
            me.pursues = 1
            r = length(me.target_x - me.x, me.target_y - me.y)
            me.error = max(0.0, r - length(arm_x, arm_y))
            return
    me.error = length(place_x - me.x, place_y - me.y)


@compiled
def wanted_motion(team: Team, me: Record, mates: Records) -> Motion:
    """Return the motion of a tracker that is not searching."""
    world, settings = team.world, team.settings
    if me.task == EXCHANGING:
        return command(me, me.target_vx, me.target_vy, me.target_turn)
    if me.fix_age > me.usual_age + settings.close_in_after and world.sight < _FAR_SIGHT:
        return hunt(team, me)
    if follows(team, me, mates):
        if me.task == FLOCKING:
            return on_leader(team, me, mates)
        place_x, place_y, vx, vy = place_on_leader(team, me, mates[me.leader], team.slots[me.slot], team.slots[0])
        vx, vy = approach_velocity(place_x - me.x, place_y - me.y, vx, vy, _FULL_SPEED, me.max_speed, me.acceleration)
        return command(me, vx, vy, 0.0)
    if settings.guidance == PNGL:
        return pursue(team, me)
    return to_slot(team, me)
