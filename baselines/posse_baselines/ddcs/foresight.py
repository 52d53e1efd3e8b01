"""Foresight over the delay and the lag of commands: decisions for the moment at which they are executed."""

from __future__ import annotations

from posse.numeric import FloatArray, Record, Records, compiled
from posse_baselines.ddcs.memory import MOST_WAITING, Team
from posse_baselines.ddcs.monitoring import target_after
from posse_baselines.ddcs.surroundings import surround
from posse_baselines.laws.geometry import clip, scaled, vector


@compiled
def delay_of(team: Team) -> int:
    """Return the delay that is foreseen, in control steps."""
    settings, delay = team.settings, int(team.world.delay)
    return delay if settings.foresight > 0.0 and delay <= MOST_WAITING else 0


@compiled
def foresee(team: Team, me: Record) -> None:
    """Take the own pose and the target to the moment at which the next command is executed, after monitoring."""
    delay, dt = delay_of(team), float(team.world.dt)
    me.lead, me.moved, me.turned = 0.0, 0j, 1.0 + 0j
    if delay == 0:
        return
    start = me.heading
    for k in range(delay):
        waiting = me.waiting[(me.step + k) % delay]
        speed, omega = me.speed, me.omega
        change, turn_change = me.acceleration * dt, me.turn_acceleration * dt
        me.speed += clip(team.world.followed * (waiting.real - speed), -change, change)
        me.omega += clip(team.world.followed * (waiting.imag - omega), -turn_change, turn_change)
        mean, turn = me.speed, me.omega * dt
        if team.world.followed < 1.0:
            mean, turn = 0.5 * (speed + me.speed), 0.5 * (omega + me.omega) * dt
        me.moved += scaled(me.heading * vector(1.0, 0.5 * turn), mean * dt)
        me.heading *= vector(1.0, turn)
    me.turned = me.heading * start.conjugate()
    me.lead = delay * dt
    me.position += me.moved
    if me.known:
        me.target, me.target_theta = target_after(team, me, me.fix_age + me.lead)
        me.target_velocity = vector(me.target_speed, me.target_theta)
        me.frame *= vector(1.0, me.psi_rate * me.lead)


@compiled
def surround_ahead(team: Team, me: Record, mates: Records, row: FloatArray, discs: Records) -> int:
    """List the discs that will be near when the command is executed; return their number.

    The sonar measures from the present pose, so that the list is made there and taken along.
    """
    if me.lead <= 0.0:
        return surround(team, me, mates, row, discs)
    lead, position, heading, target = me.lead, me.position, me.heading, me.target
    frame = me.frame
    me.lead, me.position, me.heading = 0.0, position - me.moved, heading * me.turned.conjugate()
    me.target = target - scaled(me.target_velocity, lead)
    me.frame = frame * vector(1.0, -me.psi_rate * lead)
    count = surround(team, me, mates, row, discs)
    me.lead, me.position, me.heading, me.target, me.frame = lead, position, heading, target, frame
    for k in range(count):
        discs[k].place += scaled(discs[k].velocity, lead) - me.moved
    return count


@compiled
def make_up(team: Team, me: Record, speed: float, omega: float) -> tuple[float, float]:
    """Return the command (m/s, rad/s) that makes up for the lag, and remember it until it is executed."""
    followed, share, delay = team.world.followed, team.settings.foresight, delay_of(team)
    if followed < 1.0 and share > 0.0:
        more = share * (1.0 / followed - 1.0)
        speed += more * (speed - me.speed)
        omega += more * (omega - me.omega)
    if delay > 0:
        kept = complex(clip(speed, 0.0, me.max_speed), clip(omega, -me.max_omega, me.max_omega))
        me.waiting[me.step % delay] = kept
    return speed, omega
