"""The tracking layer: the four tasks of section 3.1 with their transitions (figure 1), and the law of each.

===================  =========================================================================
searching            the target is unknown: explore (:mod:`~posse_baselines.ddcs.searching`)
converging           chase stage: at full speed to the own place
flocking             maintenance stage: the formation law, in the own place
leader exchange      another leader was appointed and has not been heard yet: hold the flock's
                     course (centralized model only)
===================  =========================================================================

A law sets the wanted velocity (m/s) for the safeguard, and the command to execute if the safeguard accepts it.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from posse.numeric import Record, Records, compiled
from posse_baselines.ddcs.memory import Team
from posse_baselines.ddcs.monitoring import is_there, mate_now, patience, silence
from posse_baselines.ddcs.roles import course_of
from posse_baselines.ddcs.settings import (
    BY_SLOT_FRAME,
    CENTRALIZED,
    CONVERGING,
    EXCHANGING,
    FLOCKING,
    L_L,
    NO_DEVIATION,
    OF_OCCUPANT,
    PNGL,
    SEARCHING,
)
from posse_baselines.laws import guidance, l_l, l_phi, steering
from posse_baselines.laws.geometry import angle_of, clip, cross, length, scaled, vector, wrap

_FULL_SPEED: Final = 1e6  # 1/s; a gain that saturates the speed at any distance
_FAR_SIGHT: Final = 8.0  # m; with a longer sensing range no motion is needed to see a lost target again
_MOST_DEVIATION: Final = 0.7  # rad; beyond, a chase hardly closes in
_LEAST_CROSSING: Final = 0.15  # sine of the angle between the lines of l-l, below which it is l-φ on the nearer robot


# --- the tasks -----------------------------------------------------------------------------------


@compiled
def follows(team: Team, me: Record, mates: Records) -> bool:
    """Return whether a tracker follows the leader, not the target."""
    settings = team.settings
    if settings.model != CENTRALIZED or me.leader < 0 or me.leader == me.number:
        return False
    leader = mates[me.leader]
    # A silent leader that cannot be replaced is followed at its last known position.
    return is_there(team, me, leader) or (settings.forbidden[FLOCKING, EXCHANGING] != 0 and leader.step >= 0)


@compiled
def next_task(team: Team, me: Record, mates: Records) -> int:
    """Return the next task.

    Converging and flocking change with hysteresis: flocking begins within ``near`` of the place and ends beyond ``far``
    of it. Under PNGL the excess of the range counts, with separate limits: chase and maintenance.
    """
    settings, task = team.settings, me.task
    if me.known == 0:
        wanted = SEARCHING
    elif me.exchanges > 0 and me.confirmed == 0 and task != SEARCHING:
        wanted = EXCHANGING
    else:
        near, far = settings.near, settings.far
        if follows(team, me, mates):
            error = length(place_by(team, me, mates[me.leader], 0).place - me.position)
        elif settings.guidance == PNGL:
            near, far = settings.range_near, settings.range_far
            arm = team.slots[me.slot] * me.frame
            error = length(me.target - me.position) - length(arm)
        else:
            error = length(me.target + team.slots[me.slot] * me.frame - me.position)
        wanted = FLOCKING if error <= (far if task == FLOCKING else near) else CONVERGING
    return task if settings.forbidden[task, wanted] else wanted


# --- the laws ------------------------------------------------------------------------------------


@compiled
def want(me: Record, velocity: complex, rate: float) -> None:
    """Set a wanted velocity (m/s) that turns at ``rate`` (rad/s), with its command."""
    me.wish = velocity
    me.wish_speed, me.wish_omega = guidance.regulate(me, velocity, rate)


@compiled
def move(team: Team, me: Record, mates: Records) -> None:
    """Set the motion of a tracker that is not searching."""
    settings = team.settings
    if me.task == EXCHANGING:
        want(me, me.target_velocity, me.target_turn)
    elif me.fix_age > me.usual_age + settings.close_in_after and team.world.sight < _FAR_SIGHT:
        hunt(team, me)
    elif follows(team, me, mates):
        if me.task == FLOCKING:
            follow(team, me, mates)
        else:
            ref = place_by(team, me, mates[me.leader], 0)
            slot = steering.slot_velocity(vector(ref.speed, ref.theta), ref.frame_rate, ref.place - ref.position)
            way = ref.place - me.position
            want(me, steering.approach_velocity(way, slot, _FULL_SPEED, me.max_speed, me.acceleration), 0.0)
    elif settings.guidance == PNGL:
        pursue(team, me)
    else:
        hold_slot(team, me)


@compiled
def hunt(team: Team, me: Record) -> None:
    """Set the motion to see a lost target again.

    The team spreads on a ring around its predicted position, slot by slot on either side of its
    heading; the ring grows with the time that it was not seen.
    """
    settings = team.settings
    side = 1.0 if me.slot % 2 else -1.0
    angle = me.target_theta + side * ((me.slot + 1) // 2) * 2.0 * math.pi / len(team.slots)
    way = me.target + vector(settings.hunt_growth * me.fix_age, angle) - me.position
    distance = length(way)
    want(me, scaled(way, min(me.max_speed, settings.gain * distance) / max(distance, 1e-6)), 0.0)


@compiled
def hold_slot(team: Team, me: Record) -> None:
    """Set the motion that takes up the slot on the target (converging) or keeps it (flocking).

    Converging: intercept at full speed, around the target; flocking: the slot law.
    """
    settings = team.settings
    arm = team.slots[me.slot] * me.frame + scaled(me.frame, settings.aim_ahead)
    gain, clearance, rate = settings.gain, 0.0, settings.feed_forward * me.psi_rate
    if me.task == CONVERGING:
        gain, clearance, rate = _FULL_SPEED, settings.clearance, 0.0
    start, course = me.position - me.target, course_of(team, me)
    want(me, steering.meeting_velocity(start, arm, course, clearance, gain, me.max_speed, me.acceleration), rate)


@compiled
def pursue(team: Team, me: Record) -> None:
    """Set the motion of PNGL: θ = K σ + c, ω = K dσ/dt + dc/dt.

    Converging is the chase at full speed, flocking the speed of (13) with a correction of the
    range. The wanted range is the slot's distance from the target.
    """
    settings, n = team.settings, len(team.slots)
    constant = float(settings.navigation_constant)
    if settings.model != CENTRALIZED and n > 1:  # K of its own
        constant += settings.spread * (2.0 * me.number / (n - 1) - 1.0)
    arm = team.slots[me.slot] * me.frame
    r, sigma = guidance.line_of_sight(me.position, me.target)
    wanted_sigma, wanted_theta, frame_rate = 0.0, 0.0, 0.0
    if settings.deviation != NO_DEVIATION:
        wanted_sigma, wanted_theta, frame_rate = angle_of(-arm), angle_of(me.frame), me.psi_rate
        if me.task == FLOCKING:
            # Feedback on the bearing, c = ... + G wrap(σ - σ_d), acts as a greater K does.
            constant += settings.bearing_gain
    if settings.deviation == OF_OCCUPANT:
        wanted_theta = steering.slot_heading(me.target_velocity, me.psi_rate, arm, wanted_theta)
        if me.task == FLOCKING:
            # In front of the target, heading away from it, the bearing turns the other way.
            constant *= clip(math.cos(wanted_theta - wanted_sigma) / guidance.MIN_COSINE, -1.0, 1.0)
    delta = guidance.deviation(guidance.lawful_heading(sigma, constant, wanted_sigma, wanted_theta), sigma)
    target = vector(me.target_speed, guidance.deviation(me.target_theta, sigma))
    if me.task == FLOCKING:
        wanted_range = length(arm)
        speed = guidance.maintenance_speed(
            target, delta, r, wanted_range, frame_rate, settings.range_gain, me.max_speed
        )
    else:
        # A chase has to close in, whichever side of the target its slot is on.
        speed, delta = float(me.max_speed), clip(delta, -_MOST_DEVIATION, _MOST_DEVIATION)
    me.closing = 1 if me.task == CONVERGING else 0
    sigma_rate = guidance.bearing_rate(r, target, vector(speed, delta))
    want(me, vector(speed, sigma + delta), guidance.lawful_rate(constant, sigma_rate, frame_rate))


# --- following -----------------------------------------------------------------------------------


class Reference(NamedTuple):
    """A team-mate that a follower keeps its place by, as it moves now."""

    position: complex
    speed: float
    theta: float
    place: complex
    """Where the follower is wanted."""
    frame: float
    """Heading (rad) of the frame that the formation is kept in: the mate's own (figure 6), or the slot frame."""
    frame_rate: float
    """rad/s"""


@compiled
def place_by(team: Team, me: Record, mate: Record, slot: int) -> Reference:
    """Return a team-mate as it moves now, and the own place by one in its ``slot``.

    A mate that has been silent for too long counts as stopped. In the first step, the mate is
    expected to move as the target does.
    """
    theta, age = angle_of(mate.heading), silence(team, me, mate)
    speed, rate = 0.0, 0.0
    if age <= patience(team, me):
        speed, rate = float(length(mate.velocity) if mate.step > 0 else me.target_speed), float(mate.turn)
        theta = wrap(theta + rate * (age + me.lead))
    frame = theta
    if team.settings.follower_frame == BY_SLOT_FRAME:
        frame, rate = angle_of(me.frame), float(me.psi_rate)
    position, _ = mate_now(team, me, mate)
    place = position + (team.slots[me.slot] - team.slots[slot]) * vector(1.0, frame)
    return Reference(position, speed, theta, place, frame, rate)


@compiled
def demand_by(team: Team, me: Record, mate: Record, slot: int) -> tuple[l_phi.Demand, float]:
    """Return the demand of l-φ on the control point c_j by a team-mate in its ``slot``, and the wanted direction of l.

    c_j is wanted where it lies when the robot is in its place, and heads as one does there.
    """
    settings, offset = team.settings, team.settings.point_offset
    ref = place_by(team, me, mate, slot)
    velocity, arm = vector(ref.speed, ref.theta), ref.place - ref.position
    heading = steering.slot_heading(velocity, ref.frame_rate, arm, ref.frame)
    l_now, angle = guidance.line_of_sight(ref.position, me.position + scaled(me.heading, offset))
    l_d, wanted = guidance.line_of_sight(ref.position, ref.place + vector(offset, heading))
    demand = l_phi.l_phi_demand(
        l_phi.Polar(l_now, wrap(angle - ref.theta)),
        l_phi.Polar(l_d, wrap(wanted - ref.theta)),
        ref.speed,
        ref.frame_rate,
        l_phi.sampled_rate(settings.alpha_1, me.dt),
        l_phi.sampled_rate(settings.alpha_2, me.dt),
    )
    return l_phi.Demand(l_now, demand, wrap(angle - angle_of(me.heading))), wanted


@compiled
def second_of(team: Team, me: Record, mates: Records) -> int:
    """Return the team-mate that a follower under l-l keeps its distance from beside the leader.

    Of those whose slots come between the leader's and its own, and who are in their places: the one
    of the last slot from which the lines to both cross widely enough in the follower's place. -1 if
    there is none.
    """
    found, place = -1, team.slots[me.slot]
    to_leader = place - team.slots[0]
    for j in range(len(mates)):
        mate = mates[j]
        if j == me.number or j == me.leader or mate.task != FLOCKING or not 0 < mate.slot < me.slot:
            continue
        if (found >= 0 and mate.slot < mates[found].slot) or not is_there(team, me, mate):
            continue
        to_mate = place - team.slots[mate.slot]
        if abs(cross(to_leader, to_mate)) >= 2.0 * _LEAST_CROSSING * (length(to_leader) * length(to_mate)):
            found = j
    return found


@compiled
def follow(team: Team, me: Record, mates: Records) -> None:
    """Set the motion of a follower in the flock: velocity of c_j, and its command.

    By l-φ on the leader, or by l-l on the leader and another robot where there is one.
    """
    offset = team.settings.point_offset
    demand, wanted = demand_by(team, me, mates[me.leader], 0)
    velocity = l_phi.point_velocity(demand)
    second = second_of(team, me, mates) if team.settings.follower_law == L_L else -1
    if second >= 0:
        other, other_wanted = demand_by(team, me, mates[second], mates[second].slot)
        velocity = l_l.l_l_velocity(demand, other, other_wanted - wanted, _LEAST_CROSSING)
    me.wish = velocity * me.heading
    speed, omega = l_phi.held_command(velocity, offset, me.dt)
    me.wish_speed, me.wish_omega = l_phi.limit_command(me, speed, omega, offset)
