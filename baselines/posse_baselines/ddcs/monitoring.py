"""The monitoring layer: one estimate of the target, a table of the team-mates, and the messages between them.

Fixes may be delayed and come from team-mates; each is extrapolated to the present. Positions are noisy, so speed is
estimated along the heading, averaged over seconds. Where commands are delayed, all is foreseen to the moment at which
the next one is executed.
"""

import math
from typing import Final

from posse.numeric import FloatArray, Record, Records, compiled
from posse_baselines.ddcs.memory import Team, pair, since
from posse_baselines.laws.geometry import angle_of, clip, dot, length, scaled, vector, wrap
from posse_baselines.laws.guidance import UNLIMITED

MESSAGE_SIZE: Final = 5
"""Task, leader, term, pulse, slot: five small whole numbers; where poses drift, with the target as seen beside them.
They are the last ones of a message."""
COUNT: Final = 256
"""Terms and pulses count modulo this."""

_MESSAGE_STEP: Final = 1.0 / 512.0
_PART: Final = 0.45  # of a step; where poses drift, a number carries a measure beside its whole number
_FARTHEST: Final = 32.0  # m; a target farther away does not align frames
_SPEED_DECAY: Final = 3.0  # s; of the target's speed in an estimate older than 1 s
_UNKNOWN_SPEED: Final = 0.6  # of the target until it has been measured, as a share of the own greatest
_TARGET_LOST: Final = 10.0  # s; a fix older than this is no longer followed
_FRAME_TRUST: Final = 0.5  # share of a new measurement in the offset between a team-mate's frame and the own one
_NO_ROW: Final = "observations that are no scenario's, perhaps normalised: numbers of trackers are out of range"
_SPEED_MEMORY: Final = 3.0  # s; time constant of the target's estimated speed


@compiled
def encode(value: int, part: float = 0.0) -> float:
    """Return a whole number, -1 (nothing) to 510, and a measure in [-1, 1] as a number in (-0.001, 1).

    Nothing without a measure is 0, as is the message of a robot that has not been heard.
    """
    return (value + 1 + _PART * part) * _MESSAGE_STEP


@compiled
def decode(number: float, count: int) -> int:
    """Inverse of :func:`encode` for whole numbers below ``count``; of any other number, -1."""
    value = round(number / _MESSAGE_STEP) - 1
    return value if 0 <= value < count else -1


@compiled
def part_of(number: float) -> float:
    """Return the measure that :func:`encode` added."""
    steps = number / _MESSAGE_STEP
    return float((steps - round(steps)) / _PART)


@compiled
def is_newer(value: int, old: int) -> bool:
    """Return whether a count modulo ``COUNT`` is ahead of another, by the shorter way."""
    ahead = (value - old) % COUNT
    return 0 < ahead < COUNT // 2


@compiled
def write_message(team: Team, me: Record, row: FloatArray, message: FloatArray) -> None:
    """Write the message of a tracker (``MESSAGE_SIZE``,).

    Where poses drift, with the target as its own sensor measured it: seen or not, position and heading in its own axes.
    """
    at, seen, way, theta = team.at, 0.0, 0j, 0.0
    if team.world.drifts != 0 and row[at.target_seen] > 0.0 and row[at.target_range] < _FARTHEST:
        seen, theta = 1.0, angle_of(pair(row, at.target_heading)) / math.pi
        way = scaled(pair(row, at.target_bearing), row[at.target_range] / _FARTHEST)
    message[0] = encode(me.task, seen)
    message[1] = encode(me.leader, way.real)
    message[2] = encode(me.term, way.imag)
    message[3] = encode(me.pulse, theta)
    message[4] = encode(me.slot)


@compiled
def align(team: Team, me: Record, mate: Record, row: FloatArray, m: int) -> None:
    """Measure the offset of a team-mate's frame by the target that both see, and correct the mate's pose.

    Its message begins at ``row[m]``. It was written one control step before the pose was sent, so that both the target
    and the pose are taken back to that moment.
    """
    at, dt = team.at, float(team.world.dt)
    if part_of(row[m]) > 0.5 and row[at.target_seen] > 0.0:
        age = since(team, me, mate.step) + dt
        theta = wrap(me.fix_theta - me.target_turn * age)
        target = me.fix - vector(me.target_speed * age, me.fix_theta - 0.5 * me.target_turn * age)
        heading = wrap(theta - math.pi * part_of(row[m + 3]))  # of the mate, then, in the own frame
        told = wrap(angle_of(mate.heading) - mate.turn * dt)
        way = complex(_FARTHEST * part_of(row[m + 1]), _FARTHEST * part_of(row[m + 2]))
        place = target - way * vector(1.0, heading)
        before = mate.position - vector(length(mate.velocity) * dt, angle_of(mate.heading) - 0.5 * mate.turn * dt)
        share = _FRAME_TRUST if mate.aligned else 1.0
        mate.twist = wrap(mate.twist + share * wrap(heading - told - mate.twist))
        mate.shift += scaled(place - before - mate.shift, share)
        mate.aligned = 1
    turned = vector(1.0, mate.twist)
    mate.position += mate.shift
    mate.heading, mate.velocity = mate.heading * turned, mate.velocity * turned


@compiled
def monitor(team: Team, me: Record, mates: Records, row: FloatArray) -> None:
    """Read what one tracker observes (F,): itself, the target, its team-mates; foresee them for the next command."""
    read_body(team, me, row)
    watch_target(team, me, row)
    update_mates(team, me, mates, row)
    foresee(team, me)
    place_mates(team, me, mates)


@compiled
def read_body(team: Team, me: Record, row: FloatArray) -> None:
    """Read the robot's number, pose, motion and limits from its observation (F,), once a step."""
    at = team.at
    if not 0.0 <= row[at.number] < len(team.slots):
        raise ValueError(_NO_ROW)
    me.number = int(row[at.number])
    me.position, me.heading = pair(row, at.position), pair(row, at.heading)
    me.speed, me.omega = row[at.speed], row[at.turn_rate]
    me.max_speed, me.max_omega = row[at.max_speed], row[at.max_turn_rate]
    me.acceleration, me.turn_acceleration = UNLIMITED, UNLIMITED
    if row[at.acceleration_time] > 0.0:
        me.acceleration = row[at.max_speed] / row[at.acceleration_time]
    if row[at.turn_acceleration_time] > 0.0:
        me.turn_acceleration = row[at.max_turn_rate] / row[at.turn_acceleration_time]
    me.dt = team.world.dt


@compiled
def target_after(team: Team, me: Record, time: float) -> tuple[complex, float]:
    """Return the target's most likely position and heading (rad) a time (s) after the newest fix.

    The turn rate decays, and after a second the speed, too: the direction gets uncertain, and the mean of the possible
    positions lags behind a target that keeps its heading.
    """
    memory = team.settings.turn_memory
    if time <= 0.0:
        return me.fix, me.fix_theta
    if time > 1.0:
        time = 1.0 + _SPEED_DECAY * (1.0 - math.exp((1.0 - time) / _SPEED_DECAY))
    turned = me.target_turn * memory * (1.0 - math.exp(-time / memory))
    return me.fix + vector(me.target_speed * time, me.fix_theta + 0.5 * turned), wrap(me.fix_theta + turned)


@compiled
def watch_target(team: Team, me: Record, row: FloatArray) -> None:
    """Update the estimate of the target with an observation (F,)."""
    at, settings, dt = team.at, team.settings, float(team.world.dt)
    if row[at.target_known] > 0.0 and (settings.radio or row[at.target_seen] > 0.0):
        fix_step = me.step - round(row[at.target_age] / dt)
        if fix_step > me.fix_step:
            take_fix(team, me, row, fix_step)
    me.known = 0
    if me.fix_step < 0:
        return
    me.fix_age = since(team, me, me.fix_step)
    if me.fix_age <= _TARGET_LOST:
        me.known = 1
    me.target, theta = target_after(team, me, me.fix_age)
    me.target_theta, me.target_velocity = theta, vector(me.target_speed, theta)
    # How fast the frame turns at most: the outermost slot has to be no faster than any tracker.
    limit = max(0.0, min(0.8 * (team.world.slowest - me.target_speed), me.target_speed)) / team.world.outermost
    me.psi_limit = limit
    psi = wrap(me.fix_psi + clip(wrap(theta - me.fix_psi), -limit * me.fix_age, limit * me.fix_age))
    # A frame at the target's heading turns at its rate. With that rate pursuit is exact for a target on a circle; the
    # slot law scores better without it against one that weaves.
    turn = me.target_turn * math.exp(-me.fix_age / settings.turn_memory) if settings.pngl else 0.0
    me.psi_rate = clip(wrap(theta - psi) / dt + turn, -limit, limit)
    me.frame = vector(1.0, psi)


@compiled
def take_fix(team: Team, me: Record, row: FloatArray, fix_step: int) -> None:
    """Take a newer fix into the estimate."""
    at, settings = team.at, team.settings
    position = me.position + scaled(pair(row, at.target_bearing) * me.heading, row[at.target_range])
    theta = angle_of(pair(row, at.target_heading) * me.heading)
    psi = angle_of(pair(row, at.target_frame) * me.heading)
    time = (fix_step - me.fix_step) * team.world.dt
    me.target_turn = 0.0
    if me.fix_step < 0:
        me.target_speed = _UNKNOWN_SPEED * me.max_speed
    elif time <= _TARGET_LOST:
        # Both headings have the same noise, and of the slot frame it is known how fast it turns.
        psi_guess = me.fix_psi + clip(wrap(theta - psi), -me.psi_limit * time, me.psi_limit * time)
        noise = (1.0 - settings.heading_trust) * wrap(psi - psi_guess)
        theta, psi = wrap(theta - noise), wrap(psi - noise)
        turned = wrap(theta - me.fix_theta)
        if time <= max(settings.turn_memory, 1.5 * team.world.dt):  # always, of fixes of successive steps
            me.target_turn = turned / time
            along = dot(position - me.fix, vector(1.0, me.fix_theta + 0.5 * turned)) / time
            share = 1.0 - math.exp(-time / _SPEED_MEMORY) if me.speed_known else 1.0
            me.target_speed = clip(me.target_speed + share * (along - me.target_speed), 0.0, me.max_speed)
            me.speed_known = 1
    me.fix, me.fix_theta, me.fix_psi, me.fix_step = position, theta, psi, fix_step


@compiled
def update_mates(team: Team, me: Record, mates: Records, row: FloatArray) -> None:
    """Update the table of team-mates (N,) with an observation (F,)."""
    at, dt = team.at, team.world.dt
    if not team.settings.radio:
        return
    me.horizon = 0.0
    for p in range(at.neighbours):
        k = p * at.stride
        number, age, away = int(row[at.neighbour_number + k]), row[at.neighbour_age + k], row[at.neighbour_range + k]
        if number < 0:
            continue
        if number >= len(mates):
            raise ValueError(_NO_ROW)
        # Nearest first: others are farther away than the last of the list, or not heard.
        if age < team.world.patience:
            me.horizon = away
        mate = mates[number]
        sent = me.step - round(age / dt)
        if sent <= mate.step:
            continue
        mate.step, mate.heard = sent, me.step
        mate.position = me.position + scaled(pair(row, at.neighbour_bearing + k) * me.heading, away)
        heading = pair(row, at.neighbour_heading + k) * me.heading
        mate.heading, mate.velocity = heading, scaled(heading, row[at.neighbour_speed + k])
        mate.turn = row[at.neighbour_turn_rate + k]
        if at.message_size >= MESSAGE_SIZE:
            m, n = at.neighbour_message + at.message_size - MESSAGE_SIZE + k, len(mates)
            mate.leader, mate.slot = decode(row[m + 1], n), decode(row[m + 4], n)
            mate.term, mate.pulse = decode(row[m + 2], COUNT), decode(row[m + 3], COUNT)
            if team.world.drifts != 0:
                align(team, me, mate, row, m)


@compiled
def foresee(team: Team, me: Record) -> None:
    """Take the own pose and the target to the moment at which the next command is executed, after monitoring."""
    delay, dt = int(team.world.delay), float(team.world.dt)
    if delay == 0:
        return
    for k in range(delay):
        waiting = me.waiting[(me.step + k) % delay]
        change, turn_change = me.acceleration * dt, me.turn_acceleration * dt
        me.speed += clip(team.world.followed * (waiting.real - me.speed), -change, change)
        me.omega += clip(team.world.followed * (waiting.imag - me.omega), -turn_change, turn_change)
        half = vector(1.0, 0.5 * me.omega * dt)
        me.position += scaled(me.heading * half, me.speed * dt)
        me.heading *= half * half
    if me.known:
        me.target, me.target_theta = target_after(team, me, me.fix_age + team.world.lead)
        me.target_velocity = vector(me.target_speed, me.target_theta)
        # Under PNGL the rate is that of a target on a circle; the heading foreseen with a decaying turn rate lags.
        most = me.psi_limit * team.world.lead
        lag = clip(wrap(me.target_theta - angle_of(me.frame)), -most, most)
        me.frame *= vector(1.0, me.psi_rate * team.world.lead if team.settings.pngl else lag)


@compiled
def place_mates(team: Team, me: Record, mates: Records) -> None:
    """Determine which team-mates count as working and in range, and where each is when the command is executed.

    One that has been silent for too long counts as stopped. Of oneself nothing is heard.
    """
    me.others = 0
    for j in range(len(mates)):
        mate = mates[j]
        silence = since(team, me, mate.step)
        mate.place = mate.position
        if silence <= team.world.patience:
            mate.place = mate.position + scaled(mate.velocity, silence + team.world.lead)
        mate.there = mate.step >= 0 and silence <= team.world.patience
        me.others += mate.there
    mates[me.number].place = me.position
