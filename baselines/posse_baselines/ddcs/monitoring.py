"""The monitoring layer: one estimate of the target, and a table of the team-mates.

Fixes may be delayed and come from team-mates; each is extrapolated to the present. Position is
noisy, heading and slot frame are not, so speed is estimated along the heading, averaged over
seconds.
"""

from __future__ import annotations

import math

from posse.numeric import FloatArray, Record, Records, compiled
from posse_baselines.ddcs.memory import Team
from posse_baselines.ddcs.messages import MESSAGE_SIZE, decode
from posse_baselines.laws.geometry import clip, length, wrap


@compiled
def extrapolate(
    team: Team, x: float, y: float, theta: float, speed: float, turn: float, time: float
) -> tuple[float, float, float]:
    """Return the most likely (x, y, θ) after a time (s), with a decaying turn rate.

    After a second the speed decays, too: the direction gets uncertain, and the mean of the possible
    positions lags behind a target that keeps its heading.
    """
    settings = team.settings
    if time <= 0.0:
        return x, y, theta
    if time > 1.0:
        time = 1.0 + settings.way_memory * (1.0 - math.exp((1.0 - time) / settings.way_memory))
    turned = turn * settings.turn_memory * (1.0 - math.exp(-time / settings.turn_memory))
    middle = theta + 0.5 * turned
    return (x + speed * time * math.cos(middle), y + speed * time * math.sin(middle), wrap(theta + turned))


@compiled
def frame_limit(speed: float, max_speed: float, outermost: float) -> float:
    """Return ω_s (rad/s), how fast the slot frame turns for a target of a given speed (m/s)."""
    return max(0.0, min(0.8 * (max_speed - speed), speed)) / outermost


@compiled
def watch_target(team: Team, me: Record, row: FloatArray) -> None:
    """Update the estimate of the target with an observation (F,)."""
    at, world, settings = team.at, team.world, team.settings
    dt = float(world.dt)
    me.sees = 1 if row[at.target_seen] > 0.0 else 0
    if row[at.target_known] > 0.0 and (settings.radio or me.sees):
        fix_step = me.step - round(row[at.target_age] / dt)
        if fix_step > me.fix_step:
            take_fix(team, me, row, fix_step)
    me.known = 0
    if me.fix_step < 0:
        return
    me.fix_age = (me.step - me.fix_step) * dt
    if me.fix_age <= settings.late_fix:
        # The usual age of fixes, to detect unusual delays.
        me.usual_age += (dt / settings.gap_memory) * (me.fix_age - me.usual_age)
    if me.fix_age <= settings.target_lost_after:
        me.known = 1
    x, y, theta = extrapolate(team, me.fix_x, me.fix_y, me.fix_theta, me.target_speed, me.target_turn, me.fix_age)
    me.target_x, me.target_y, me.target_theta = x, y, theta
    limit = frame_limit(me.target_speed, me.max_speed, team.outermost)
    psi = wrap(me.fix_psi + clip(wrap(theta - me.fix_psi), -limit * me.fix_age, limit * me.fix_age))
    turn = settings.turn_share * me.target_turn * math.exp(-me.fix_age / settings.turn_memory)
    me.psi_rate = clip(wrap(theta - psi) / dt + turn, -limit, limit)
    # Computed once for all slots and discs of this step.
    me.target_vx, me.target_vy = me.target_speed * math.cos(theta), me.target_speed * math.sin(theta)
    me.frame_cos, me.frame_sin = math.cos(psi), math.sin(psi)


@compiled
def take_fix(team: Team, me: Record, row: FloatArray, fix_step: int) -> None:
    """Blend a newer fix into the estimate."""
    at, settings = team.at, team.settings
    hc, hs = me.heading_cos, me.heading_sin
    r = float(row[at.target_range])
    bc, bs = float(row[at.target_bearing]), float(row[at.target_bearing + 1])
    x = me.x + r * (bc * hc - bs * hs)
    y = me.y + r * (bc * hs + bs * hc)
    tc, ts = float(row[at.target_heading]), float(row[at.target_heading + 1])
    heading_c, heading_s = tc * hc - ts * hs, tc * hs + ts * hc
    theta = math.atan2(heading_s, heading_c)
    fc, fs = float(row[at.target_frame]), float(row[at.target_frame + 1])
    psi = math.atan2(fc * hs + fs * hc, fc * hc - fs * hs)
    time = (fix_step - me.fix_step) * team.world.dt
    if me.fix_step < 0 or time > settings.target_lost_after:
        me.fix_x, me.fix_y, me.target_turn = x, y, 0.0
        if me.speed_known == 0:
            me.target_speed = settings.unknown_speed * me.max_speed
        me.mean_vx, me.mean_vy = me.target_speed * heading_c, me.target_speed * heading_s
    else:
        guess_x, guess_y, _ = extrapolate(team, me.fix_x, me.fix_y, me.fix_theta, me.target_speed, me.target_turn, time)
        turned = wrap(theta - me.fix_theta)
        if time <= settings.turn_memory:
            me.target_turn = turned / time
            middle = me.fix_theta + 0.5 * turned
            along = ((x - me.raw_x) * math.cos(middle) + (y - me.raw_y) * math.sin(middle)) / time
            share = 1.0 - math.exp(-time / settings.speed_memory) if me.speed_known else 1.0
            me.target_speed = clip(me.target_speed + share * (along - me.target_speed), 0.0, me.max_speed)
            me.speed_known = 1
        else:
            me.target_turn = 0.0
        trust = settings.fix_trust
        if length(x - guess_x, y - guess_y) > settings.fix_jump:
            trust = 1.0
        me.fix_x = guess_x + trust * (x - guess_x)
        me.fix_y = guess_y + trust * (y - guess_y)
        share = 1.0 - math.exp(-time / settings.mean_memory)
        me.mean_vx += share * (me.target_speed * heading_c - me.mean_vx)
        me.mean_vy += share * (me.target_speed * heading_s - me.mean_vy)
    me.raw_x, me.raw_y, me.fix_theta, me.fix_psi, me.fix_step = x, y, theta, psi, fix_step


@compiled
def update_mates(team: Team, me: Record, mates: Records, row: FloatArray) -> None:
    """Update the table of team-mates (N,) with an observation (F,)."""
    at, world, settings = team.at, team.world, team.settings
    for j in range(len(mates)):
        mates[j].fresh = 0
    me.usual_gap -= me.usual_gap * min(1.0, world.dt / settings.gap_memory)
    if not settings.radio:
        return
    hc, hs = me.heading_cos, me.heading_sin
    me.horizon = 0.0
    for p in range(at.neighbours):
        k = p * at.stride
        number = int(row[at.neighbour_number + k])
        if number < 0:
            continue
        # Nearest first: others are farther away than the last of the list, or not heard.
        if row[at.neighbour_age + k] < settings.lost_after:
            me.horizon = float(row[at.neighbour_range + k])
        mate = mates[number]
        sent = me.step - round(row[at.neighbour_age + k] / world.dt)
        if sent <= mate.step:
            continue
        if mate.step >= 0:
            gap = float((sent - mate.step) * world.dt + row[at.neighbour_age + k])
            if gap < settings.lost_after:
                me.usual_gap = max(me.usual_gap, gap)
        mate.step, mate.fresh = sent, 1
        r = float(row[at.neighbour_range + k])
        bc, bs = float(row[at.neighbour_bearing + k]), float(row[at.neighbour_bearing + k + 1])
        mate.x = me.x + r * (bc * hc - bs * hs)
        mate.y = me.y + r * (bc * hs + bs * hc)
        c, t = float(row[at.neighbour_heading + k]), float(row[at.neighbour_heading + k + 1])
        cosine, sine = c * hc - t * hs, c * hs + t * hc
        speed = float(row[at.neighbour_speed + k])
        mate.heading_cos, mate.heading_sin = cosine, sine
        mate.speed_x, mate.speed_y = speed * cosine, speed * sine
        mate.turn = row[at.neighbour_turn_rate + k]
        if at.message_size >= MESSAGE_SIZE:
            m = at.neighbour_message + k
            mate.task, mate.leader, mate.term = decode(row[m]), decode(row[m + 1]), decode(row[m + 2])
            mate.pulse, mate.slot = decode(row[m + 3]), decode(row[m + 4])


@compiled
def patience(team: Team, me: Record) -> float:
    """Return the timeout (s) of a silence: over twice the usual."""
    settings = team.settings
    return float(min(settings.lost_after, settings.least_patience + 2.0 * me.usual_gap))


@compiled
def is_there(team: Team, me: Record, mate: Record) -> bool:
    """Return whether a team-mate counts as working and in range."""
    at, world, settings = team.at, team.world, team.settings
    if mate.step < 0:
        return False
    time = patience(team, me) if at.neighbours >= len(team.slots) - 1 else settings.unseen_memory
    return bool((me.step - mate.step) * world.dt <= time)


@compiled
def mate_now(team: Team, me: Record, mate: Record) -> tuple[float, float]:
    """Return the predicted position of a team-mate; after a long silence it counts as stopped."""
    world = team.world
    age = (me.step - mate.step) * world.dt
    if age > patience(team, me):
        return mate.x, mate.y
    return mate.x + age * mate.speed_x, mate.y + age * mate.speed_y
