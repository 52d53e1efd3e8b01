"""Followers of the centralized model: places on the leader, and the commands of l-φ and l-l."""

from __future__ import annotations

import math

from posse.numeric import Record, Records, compiled
from posse_baselines.ddcs.memory import Team
from posse_baselines.ddcs.monitoring import is_there, mate_now, patience
from posse_baselines.ddcs.settings import BY_SLOT_FRAME, FLOCKING, L_L
from posse_baselines.laws.geometry import length, line_of_sight, wrap
from posse_baselines.laws.l_l import l_l_velocity
from posse_baselines.laws.l_phi import held_command, l_phi_demand, limit_command, point_velocity, sampled_rate
from posse_baselines.laws.slots import rotate, slot_heading, slot_velocity


@compiled
def motion_of(team: Team, me: Record, mate: Record) -> tuple[float, float, float]:
    """Return speed (m/s), heading (rad, now) and turn rate (rad/s) of a team-mate.

    A mate that has been silent for too long counts as stopped. In the first step, the mate is
    expected to move as the target does.
    """
    world = team.world
    theta = math.atan2(float(mate.heading_sin), float(mate.heading_cos))
    age = float((me.step - mate.step) * world.dt)
    if age > patience(team, me):
        return 0.0, theta, 0.0
    speed, turn = length(mate.speed_x, mate.speed_y), float(mate.turn)
    if mate.step == 0:
        speed = float(me.target_speed)
    return speed, wrap(theta + turn * age), turn


@compiled
def place_and_frame(
    team: Team, me: Record, mate: Record, own: Record, theirs: Record
) -> tuple[float, float, float, float, float, float, float, float]:
    """Return a place in the formation relative to a team-mate in its place.

    The mate's place (x, y) now, the wanted place (x, y), the mate's speed (m/s) and heading (rad),
    heading (rad) and turn rate (rad/s) of the frame that the formation is kept in: the mate's own
    (figure 6), or the slot frame.
    """
    settings = team.settings
    mate_x, mate_y = mate_now(team, me, mate)
    speed, theta, frame_rate = motion_of(team, me, mate)
    frame = theta
    if settings.follower_frame == BY_SLOT_FRAME:
        frame, frame_rate = math.atan2(me.frame_sin, me.frame_cos), float(me.psi_rate)
    arm_x, arm_y = rotate(own.x - theirs.x, own.y - theirs.y, math.cos(frame), math.sin(frame))
    return mate_x, mate_y, mate_x + arm_x, mate_y + arm_y, speed, theta, frame, frame_rate


@compiled
def place_on_leader(
    team: Team, me: Record, mate: Record, own: Record, theirs: Record
) -> tuple[float, float, float, float]:
    """Return the wanted place (x, y), m, by a team-mate, and its velocity (x, y), m/s."""
    mate_x, mate_y, place_x, place_y, speed, theta, _, rate = place_and_frame(team, me, mate, own, theirs)
    vx, vy = slot_velocity(speed * math.cos(theta), speed * math.sin(theta), rate, place_x - mate_x, place_y - mate_y)
    return place_x, place_y, vx, vy


@compiled
def demand_on(
    team: Team, me: Record, mate: Record, own: Record, theirs: Record
) -> tuple[float, float, float, float, float]:
    """Return the demand of l-φ on a team-mate for the control point c_j, and its position.

    (l, A, B, direction now, wanted direction): the directions of l in the common frame. c_j is
    wanted where it lies when the robot is in its place, and heads as one does there.
    """
    settings = team.settings
    mate_x, mate_y, place_x, place_y, speed, theta, frame, rate = place_and_frame(team, me, mate, own, theirs)
    heading = slot_heading(
        speed * math.cos(theta), speed * math.sin(theta), rate, place_x - mate_x, place_y - mate_y, frame
    )
    offset = settings.point_offset
    l_now, angle = line_of_sight(mate_x, mate_y, me.x + offset * me.heading_cos, me.y + offset * me.heading_sin)
    l_d, wanted = line_of_sight(
        mate_x, mate_y, place_x + offset * math.cos(heading), place_y + offset * math.sin(heading)
    )
    a, b = l_phi_demand(
        l_now,
        wrap(angle - theta),
        l_d,
        wrap(wanted - theta),
        speed,
        rate,
        sampled_rate(settings.alpha_1, me.dt),
        sampled_rate(settings.alpha_2, me.dt),
    )
    return l_now, a, b, angle, wanted


@compiled
def second_of(team: Team, me: Record, mates: Records) -> int:
    """Return the team-mate that a follower under l-l keeps its distance from beside the leader.

    Of those whose slots come between the leader's and its own, and who are in their places: the one
    of the last slot from which the lines to both cross widely enough in the follower's place. -1 if
    there is none.
    """
    settings = team.settings
    found, n = -1, len(team.slots)
    place, first = team.slots[me.slot], team.slots[0]
    lead_x, lead_y = place.x - first.x, place.y - first.y
    for j in range(n):
        mate = mates[j]
        if j == me.number or j == me.leader or mate.task != FLOCKING or not 0 < mate.slot < me.slot:
            continue
        if (found >= 0 and mate.slot < mates[found].slot) or not is_there(team, me, mate):
            continue
        dx, dy = place.x - team.slots[mate.slot].x, place.y - team.slots[mate.slot].y
        widest = length(lead_x, lead_y) * length(dx, dy)
        if abs(lead_x * dy - lead_y * dx) >= 2.0 * settings.least_crossing * widest:
            found = j
    return found


@compiled
def on_leader(team: Team, me: Record, mates: Records) -> tuple[float, float, float, float]:
    """Return (vx, vy, V, ω) of a follower in the flock: velocity of c_j, and command.

    By l-φ on the leader, or by l-l on the leader and another robot where there is one.
    """
    settings = team.settings
    leader, place = mates[me.leader], team.slots[me.slot]
    l_i, a, b, angle, wanted = demand_on(team, me, leader, place, team.slots[0])
    theta = math.atan2(me.heading_sin, me.heading_cos)
    gamma = wrap(angle - theta)
    second = second_of(team, me, mates) if settings.follower_law == L_L else -1
    if second < 0:
        ahead, across = point_velocity(a, b, gamma)
    else:
        mate = mates[second]
        l_k, a_k, b_k, angle_k, wanted_k = demand_on(team, me, mate, place, team.slots[mate.slot])
        ahead, across = l_l_velocity(
            l_i, a, b, gamma, l_k, a_k, b_k, wrap(angle_k - theta), wanted_k - wanted, settings.least_crossing
        )
    vx, vy = rotate(ahead, across, me.heading_cos, me.heading_sin)
    speed, omega = held_command(ahead, across, settings.point_offset, me.dt)
    speed, omega = limit_command(speed, omega, settings.point_offset, me.max_speed, me.max_omega)
    return vx, vy, speed, omega
