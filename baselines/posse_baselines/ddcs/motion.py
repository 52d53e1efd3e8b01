"""The tracking layer: the four tasks of section 3.1 with their transitions (figure 1), and the law of each.

===================  =========================================================================
searching            the target is unknown: explore, away from team-mates and borders
converging           chase stage: at full speed to the own place
flocking             maintenance stage: the formation law, in the own place
leader exchange      another leader was appointed and has not been heard yet: hold the flock's
                     course (centralized model only)
===================  =========================================================================

A law sets the wanted velocity (m/s) for the safeguard, and the command to execute if the safeguard accepts it.
"""

import math
from typing import Final, NamedTuple

from posse.numeric import Record, Records, compiled
from posse_baselines.ddcs.memory import Team, since
from posse_baselines.ddcs.settings import CONVERGING, EXCHANGING, FLOCKING, SEARCHING
from posse_baselines.laws import formation, guidance, steering
from posse_baselines.laws.geometry import angle_of, clip, length, scaled, unit, vector, wrap

_FULL_SPEED: Final = 1e6  # 1/s; a gain that saturates the speed at any distance
_MOST_DEVIATION: Final = 0.7  # rad; beyond, a chase hardly closes in
_BORDER: Final = 1.5  # push of a border, at most; one as strong as the own heading would stop the robot


@compiled
def follows(team: Team, me: Record, mates: Records) -> bool:
    """Return whether a tracker follows the leader, not the target."""
    settings = team.settings
    if not settings.centralized or me.leader < 0 or me.leader == me.number:
        return False
    leader = mates[me.leader]
    # A silent leader that cannot be replaced is followed at its last known position.
    return bool(leader.there) or (settings.forbidden[FLOCKING, EXCHANGING] != 0 and leader.step >= 0)


class Guide(NamedTuple):
    """The robot by which a tracker has its place, as that robot moves now: the target, or the leader."""

    leads: bool
    """It is the leader."""
    position: complex
    velocity: complex
    frame: complex
    """Heading of the frame that the formation is kept in: the slot frame, or the leader's own (figure 6)."""
    frame_rate: float
    """rad/s"""
    arm: complex
    """From it to the own place, m."""


@compiled
def guide_of(team: Team, me: Record, mates: Records) -> Guide:
    """Return the robot by which a tracker has its place.

    A leader that has been silent for too long counts as stopped. In the first step, it is expected to move as the
    target.
    """
    position, velocity = complex(me.target), complex(me.target_velocity)
    frame, rate, slot = complex(me.frame), float(me.psi_rate), complex(team.slots[me.slot])
    leads = follows(team, me, mates)
    if leads:
        leader = mates[me.leader]
        age, speed, turn = since(team, me, leader.step), 0.0, 0.0
        heading = complex(leader.heading)
        if age <= team.world.patience:
            speed, turn = float(length(leader.velocity) if leader.step > 0 else me.target_speed), float(leader.turn)
            heading *= vector(1.0, turn * (age + team.world.lead))
        position, velocity, slot = leader.place, scaled(heading, speed), slot - team.slots[0]
        if not team.settings.by_slot_frame:
            frame, rate = heading, turn
    return Guide(leads, position, velocity, frame, rate, slot * frame)


@compiled
def next_task(team: Team, me: Record, guide: Guide) -> int:
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
        near, far, error = settings.near, settings.far, length(guide.position + guide.arm - me.position)
        if settings.pngl and not guide.leads:
            near, far = settings.range_near, settings.range_far
            error = length(guide.position - me.position) - length(guide.arm)
        wanted = FLOCKING if error <= (far if task == FLOCKING else near) else CONVERGING
    return task if settings.forbidden[task, wanted] else wanted


@compiled
def want(me: Record, velocity: complex, rate: float = 0.0) -> None:
    """Set a wanted velocity (m/s) that turns at ``rate`` (rad/s), with its command."""
    me.wish = velocity
    me.wish_speed, me.wish_omega = guidance.regulate(me, velocity, rate)


@compiled
def move(team: Team, me: Record, mates: Records, guide: Guide) -> None:
    """Set the motion of a tracker by its task."""
    settings = team.settings
    me.closing = 0
    if me.task == SEARCHING or me.slot < 0:
        want(me, explore(team, me, mates))
    elif me.task == EXCHANGING:
        want(me, me.target_velocity, me.target_turn)
    elif me.fix_age > team.world.patience + settings.close_in_after:
        # To where the target is predicted, to see it again.
        way = me.target - me.position
        want(me, scaled(unit(way), min(me.max_speed, settings.gain * length(way))))
    elif guide.leads and me.task == FLOCKING:
        follow(team, me, guide)
    elif settings.pngl and not guide.leads:
        pursue(team, me)
    else:
        take_place(team, me, guide)


@compiled
def take_place(team: Team, me: Record, guide: Guide) -> None:
    """Set the motion that takes up the own place by the guide (converging) or keeps it (flocking): the slot law.

    Converging: intercept at full speed, around the target.
    """
    settings = team.settings
    arm = guide.arm + scaled(me.frame, settings.aim_ahead)
    start, goal, gain = me.position - me.target, guide.position + arm - me.target, settings.gain
    if me.task == CONVERGING:
        goal, gain = steering.way_round(start, goal), _FULL_SPEED
    slot = steering.slot_velocity(guide.velocity, guide.frame_rate, arm)
    want(me, steering.approach_velocity(goal - start, slot, gain, me.max_speed))


@compiled
def pursue(team: Team, me: Record) -> None:
    """Set the motion of PNGL: θ = K σ + c, ω = K dσ/dt + dc/dt.

    Converging is the chase at full speed, flocking the speed of (13) with a correction of the
    range. The wanted range is the slot's distance from the target.
    """
    settings, n = team.settings, len(team.slots)
    constant = float(settings.navigation_constant)
    if not settings.centralized and n > 1:  # K of its own
        constant += settings.spread * (2.0 * me.number / (n - 1) - 1.0)
    arm = team.slots[me.slot] * me.frame
    r, sigma = guidance.line_of_sight(me.position, me.target)
    wanted_sigma, wanted_theta, frame_rate = 0.0, 0.0, 0.0
    if settings.deviates:
        wanted_sigma, wanted_theta, frame_rate = angle_of(-arm), angle_of(me.frame), me.psi_rate
        if me.task == FLOCKING:
            # Feedback on the bearing, c = ... + G wrap(σ - σ_d), acts as a greater K does.
            constant += settings.bearing_gain
    if settings.as_occupant:
        wanted_theta = steering.slot_heading(me.target_velocity, me.psi_rate, arm, wanted_theta)
        if me.task == FLOCKING:
            # In front of the target, heading away from it, the bearing turns the other way.
            constant *= clip(math.cos(wanted_theta - wanted_sigma) / guidance.MIN_COSINE, -1.0, 1.0)
    delta = wrap(guidance.lawful_heading(sigma, constant, wanted_sigma, wanted_theta) - sigma)
    target = vector(me.target_speed, wrap(me.target_theta - sigma))
    if me.task == FLOCKING:
        speed = guidance.maintenance_speed(target, delta, r, length(arm), frame_rate, settings.range_gain, me.max_speed)
    else:
        # A chase has to close in, whichever side of the target its slot is on.
        speed, delta = float(me.max_speed), clip(delta, -_MOST_DEVIATION, _MOST_DEVIATION)
        me.closing = 1
    sigma_rate = guidance.bearing_rate(r, target, vector(speed, delta))
    want(me, vector(speed, sigma + delta), guidance.lawful_rate(constant, sigma_rate, frame_rate))


@compiled
def follow(team: Team, me: Record, guide: Guide) -> None:
    """Set the motion of a follower in the flock by l-φ on the leader: velocity of c_j, and its command.

    c_j is wanted where it lies when the robot is in its place, and heads as one does there.
    """
    settings, offset = team.settings, team.settings.point_offset
    heading = steering.slot_heading(guide.velocity, guide.frame_rate, guide.arm, angle_of(guide.frame))
    me.wish = formation.l_phi_velocity(
        me.position + scaled(me.heading, offset) - guide.position,
        guide.arm + vector(offset, heading),
        guide.velocity,
        guide.frame_rate,
        formation.sampled_rate(settings.alpha_1, me.dt),
        formation.sampled_rate(settings.alpha_2, me.dt),
    )
    speed, omega = formation.held_command(me.wish * me.heading.conjugate(), offset, me.dt)
    me.wish_speed, me.wish_omega = formation.limit_command(me, speed, omega, offset)


@compiled
def explore(team: Team, me: Record, mates: Records) -> complex:
    """Return the velocity (m/s) of a tracker that searches: ahead, by its pull, away from team-mates and borders.

    On the open plane a lost target is searched for around its predicted position.
    """
    world, settings = team.world, team.settings
    off = me.position - (me.target if world.walled == 0 and me.fix_step >= 0 else 0j)
    way = me.heading + me.pull + scaled(steering.push_inwards(off, world.inner), _BORDER)
    for j in range(len(mates)):
        if mates[j].there:
            way += steering.push_from(mates[j].place - me.position, settings.apart)
    return scaled(unit(way), me.max_speed)
