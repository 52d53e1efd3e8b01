"""The monitoring layer: one estimate of the target, and a table of the team-mates.

Fixes may be delayed and come from team-mates; each is extrapolated to the present. Position is
noisy, heading and slot frame are not, so speed is estimated along the heading, averaged over
seconds.
"""

from __future__ import annotations

import math

from posse.numeric import FloatArray, Record, Records, compiled
from posse_baselines.ddcs.messages import decode
from posse_baselines.laws.geometry import clip, length, wrap


@compiled
def carry_on(
    s: Record, x: float, y: float, theta: float, speed: float, turn: float, time: float
) -> tuple[float, float, float]:
    """Return the most likely (x, y, θ) after a time (s), with a decaying turn rate.

    After a second the speed decays, too: the direction gets uncertain, and the mean of the possible
    positions lags behind a target that keeps its heading.
    """
    if time <= 0.0:
        return x, y, theta
    if time > 1.0:
        time = 1.0 + s.way_memory * (1.0 - math.exp((1.0 - time) / s.way_memory))
    turned = turn * s.turn_memory * (1.0 - math.exp(-time / s.turn_memory))
    middle = theta + 0.5 * turned
    return (x + speed * time * math.cos(middle), y + speed * time * math.sin(middle), wrap(theta + turned))


@compiled
def frame_limit(speed: float, max_speed: float, outermost: float) -> float:
    """Return ω_s (rad/s), how fast the slot frame turns for a target of a given speed (m/s)."""
    return max(0.0, min(0.8 * (max_speed - speed), speed)) / outermost


@compiled
def watch_target(f: Record, s: Record, d: Record, o: FloatArray, outermost: float) -> None:
    """Update the estimate of the target with an observation (F,)."""
    dt = float(f.dt)
    d.sees = 1 if o[f.target_seen] > 0.0 else 0
    if o[f.target_known] > 0.0 and (s.radio or d.sees):
        fix_step = d.step - round(o[f.target_age] / dt)
        if fix_step > d.fix_step:
            take_fix(f, s, d, o, fix_step, dt)
    d.known = 0
    if d.fix_step < 0:
        return
    d.age = (d.step - d.fix_step) * dt
    if d.age <= s.late_fix:
        # The usual age of fixes, to detect unusual delays.
        d.usual_age += (dt / s.gap_memory) * (d.age - d.usual_age)
    if d.age <= s.target_lost_after:
        d.known = 1
    x, y, theta = carry_on(s, d.x, d.y, d.theta, d.speed, d.turn, d.age)
    d.now_x, d.now_y, d.now_theta = x, y, theta
    limit = frame_limit(d.speed, float(o[f.max_speed]), outermost)
    psi = wrap(d.psi + clip(wrap(theta - d.psi), -limit * d.age, limit * d.age))
    turn = s.turn_share * d.turn * math.exp(-d.age / s.turn_memory)
    d.psi_rate = clip(wrap(theta - psi) / dt + turn, -limit, limit)
    # Computed once for all slots and discs of this step.
    d.speed_x, d.speed_y = d.speed * math.cos(theta), d.speed * math.sin(theta)
    d.frame_cos, d.frame_sin = math.cos(psi), math.sin(psi)


@compiled
def take_fix(f: Record, s: Record, d: Record, o: FloatArray, fix_step: int, dt: float) -> None:
    """Blend a newer fix into the estimate."""
    hc, hs = float(o[f.heading]), float(o[f.heading + 1])
    r = float(o[f.target_range])
    bc, bs = float(o[f.target_bearing]), float(o[f.target_bearing + 1])
    x = o[f.position] + r * (bc * hc - bs * hs)
    y = o[f.position + 1] + r * (bc * hs + bs * hc)
    tc, ts = float(o[f.target_heading]), float(o[f.target_heading + 1])
    heading_c, heading_s = tc * hc - ts * hs, tc * hs + ts * hc
    theta = math.atan2(heading_s, heading_c)
    fc, fs = float(o[f.target_frame]), float(o[f.target_frame + 1])
    psi = math.atan2(fc * hs + fs * hc, fc * hc - fs * hs)
    time = (fix_step - d.fix_step) * dt
    if d.fix_step < 0 or time > s.target_lost_after:
        d.x, d.y, d.turn = x, y, 0.0
        if d.speed_known == 0:
            d.speed = s.unknown_speed * o[f.max_speed]
        d.mean_x, d.mean_y = d.speed * heading_c, d.speed * heading_s
    else:
        guess_x, guess_y, _ = carry_on(s, d.x, d.y, d.theta, d.speed, d.turn, time)
        turned = wrap(theta - d.theta)
        if time <= s.turn_memory:
            d.turn = turned / time
            middle = d.theta + 0.5 * turned
            along = ((x - d.raw_x) * math.cos(middle) + (y - d.raw_y) * math.sin(middle)) / time
            share = 1.0 - math.exp(-time / s.speed_memory) if d.speed_known else 1.0
            d.speed = clip(d.speed + share * (along - d.speed), 0.0, float(o[f.max_speed]))
            d.speed_known = 1
        else:
            d.turn = 0.0
        trust = s.fix_trust
        if length(x - guess_x, y - guess_y) > s.fix_jump:
            trust = 1.0
        d.x = guess_x + trust * (x - guess_x)
        d.y = guess_y + trust * (y - guess_y)
        share = 1.0 - math.exp(-time / s.mean_memory)
        d.mean_x += share * (d.speed * heading_c - d.mean_x)
        d.mean_y += share * (d.speed * heading_s - d.mean_y)
    d.raw_x, d.raw_y, d.theta, d.psi, d.fix_step = x, y, theta, psi, fix_step


@compiled
def hear_mates(f: Record, s: Record, d: Record, mates: Records, o: FloatArray) -> None:
    """Update the table of team-mates (N,) with an observation (F,)."""
    for j in range(len(mates)):
        mates[j].fresh = 0
    d.usual_gap -= d.usual_gap * min(1.0, f.dt / s.gap_memory)
    if not s.radio:
        return
    hc, hs = float(o[f.heading]), float(o[f.heading + 1])
    d.horizon = 0.0
    for p in range(f.neighbours):
        k = p * f.stride
        number = int(o[f.neighbour_number + k])
        if number < 0:
            continue
        # Nearest first: others are farther away than the last of the list, or not heard.
        if o[f.neighbour_age + k] < s.lost_after:
            d.horizon = float(o[f.neighbour_range + k])
        mate = mates[number]
        sent = d.step - round(o[f.neighbour_age + k] / f.dt)
        if sent <= mate.step:
            continue
        if mate.step >= 0:
            gap = float((sent - mate.step) * f.dt + o[f.neighbour_age + k])
            if gap < s.lost_after:
                d.usual_gap = max(d.usual_gap, gap)
        mate.step, mate.fresh = sent, 1
        r = float(o[f.neighbour_range + k])
        bc, bs = float(o[f.neighbour_bearing + k]), float(o[f.neighbour_bearing + k + 1])
        mate.x = o[f.position] + r * (bc * hc - bs * hs)
        mate.y = o[f.position + 1] + r * (bc * hs + bs * hc)
        c, t = float(o[f.neighbour_heading + k]), float(o[f.neighbour_heading + k + 1])
        cosine, sine = c * hc - t * hs, c * hs + t * hc
        speed = float(o[f.neighbour_speed + k])
        mate.heading_cos, mate.heading_sin = cosine, sine
        mate.speed_x, mate.speed_y = speed * cosine, speed * sine
        mate.turn = o[f.neighbour_turn_rate + k]
        m = f.neighbour_message + k
        mate.task, mate.leader, mate.term = decode(o[m]), decode(o[m + 1]), decode(o[m + 2])
        mate.pulse, mate.slot = decode(o[m + 3]), decode(o[m + 4])


@compiled
def patience(s: Record, d: Record) -> float:
    """Return the timeout (s) of a silence: over twice the usual."""
    return float(min(s.lost_after, s.least_patience + 2.0 * d.usual_gap))


@compiled
def is_there(f: Record, s: Record, d: Record, mate: Record, size: int) -> bool:
    """Return whether a team-mate counts as working and in range."""
    if mate.step < 0:
        return False
    time = patience(s, d) if f.neighbours >= size - 1 else s.unseen_memory
    return bool((d.step - mate.step) * f.dt <= time)


@compiled
def mate_now(f: Record, s: Record, d: Record, mate: Record) -> tuple[float, float]:
    """Return the predicted position of a team-mate; after a long silence it counts as stopped."""
    age = (d.step - mate.step) * f.dt
    if age > patience(s, d):
        return mate.x, mate.y
    return mate.x + age * mate.speed_x, mate.y + age * mate.speed_y
