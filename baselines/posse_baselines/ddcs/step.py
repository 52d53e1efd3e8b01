"""A control step of the DDCS: monitoring and tracking (:func:`propose`), then actuation (:func:`carry_out`).

Between the two, a wanted velocity may be corrected. The correction comes before the safeguard, so that a corrected
team avoids contact as well as the team itself does.
"""

from __future__ import annotations

from posse.numeric import FloatArray, Record, Records, compiled
from posse_baselines.ddcs.actuation import detour, foresee, make_up, surround
from posse_baselines.ddcs.belief import write_belief
from posse_baselines.ddcs.memory import Seen, Team, Work, for_each, read_body
from posse_baselines.ddcs.monitoring import update_mates, watch_target, write_message
from posse_baselines.ddcs.motion import move, next_task, want
from posse_baselines.ddcs.roles import choose_slot, settle_lead
from posse_baselines.ddcs.searching import begin_search, look_around, wander
from posse_baselines.ddcs.settings import CENTRALIZED, FLOCKING, SEARCHING
from posse_baselines.laws.geometry import length, scaled
from posse_baselines.laws.guidance import regulate, write_motion
from posse_baselines.laws.safeguard import safe_velocity


@compiled
def monitor(team: Team, me: Record, mates: Records, row: FloatArray) -> None:
    """Take what one tracker observes (F,) into its memory."""
    read_body(team, me, row)
    watch_target(team, me, row)
    update_mates(team, me, mates, row)


@compiled
def propose(
    team: Team, me: Record, mates: Records, seen: Seen, row: FloatArray, work: Work, proposal: FloatArray
) -> None:
    """Monitor and track: write the velocity that one tracker wants, ahead and left, in shares of its top speed.

    What it believes is written behind that if there is room: (2,) or (2 + BELIEF_SIZE,).
    """
    # Monitoring
    monitor(team, me, mates, row)
    look_around(team, me, mates, seen)
    foresee(team, me)
    # Tracking
    if team.settings.model == CENTRALIZED:
        settle_lead(team, me, mates)
    me.closing = 0
    if me.known == 0:
        me.slot = -1
        if me.task != SEARCHING:
            begin_search(team, me, seen)
    elif me.slot < 0 or me.step % max(1, round(team.settings.replan_time / team.world.dt)) == 0:
        choose_slot(team, me, mates, work)
    me.task = next_task(team, me, mates)
    if me.task == SEARCHING or me.slot < 0:
        want(me, wander(team, me, mates, seen), 0.0)
    else:
        move(team, me, mates)
    own = me.wish * me.heading.conjugate()
    proposal[0], proposal[1] = own.real / me.max_speed, own.imag / me.max_speed
    if len(proposal) > 2:
        write_belief(team, me, mates, seen, proposal[2:])


@compiled
def correct(me: Record, correction: complex) -> None:
    """Add to the wanted velocity, ahead and to the left, in shares of the greatest speed, which also limits the sum.

    The command changes by what regulation of the two velocities differs by, so that a small
    correction changes little, whatever law the command came from.
    """
    if correction == 0j:
        return
    wish = me.wish + scaled(correction * me.heading, me.max_speed)
    excess = max(1.0, length(wish) / max(me.max_speed, length(me.wish)))
    wish = complex(wish.real / excess, wish.imag / excess)
    old_speed, old_omega = regulate(me, me.wish, 0.0)
    speed, omega = regulate(me, wish, 0.0)
    me.wish = wish
    me.wish_speed += speed - old_speed
    me.wish_omega += omega - old_omega


@compiled
def carry_out(
    team: Team, me: Record, mates: Records, seen: Seen, row: FloatArray, work: Work, action: FloatArray
) -> None:
    """Actuate: write the action (2 + m,) of one tracker, whose first two numbers are a correction of what it wants."""
    correct(me, complex(float(action[0]), float(action[1])))
    discs = work.discs[: surround(team, me, mates, row, work.discs)]
    velocity, speed, omega = me.wish, me.wish_speed, me.wish_omega
    if team.settings.detour > 0.0 and me.task != FLOCKING:
        velocity = detour(team, me, discs, velocity)
    turned = velocity != me.wish
    velocity, evades = safe_velocity(me, discs, velocity, work.plays)
    if turned or evades:
        speed, omega = regulate(me, velocity, 0.0)
    speed, omega = make_up(team, me, speed, omega)
    write_motion(action, speed, omega, me.max_speed, me.max_omega)
    write_message(team, me, row, action)
    me.step += 1


@compiled
def guard(team: Team, me: Record, mates: Records, seen: Seen, row: FloatArray, work: Work, action: FloatArray) -> None:
    """Make a wanted velocity safe that is not the script's: it stands in the action (2 + m,), which is overwritten.

    It is relative to the observed heading, and carried out from the pose at which the command is executed.
    """
    monitor(team, me, mates, row)
    wanted = complex(float(action[0]), float(action[1]))
    wanted = scaled(wanted * me.heading, me.max_speed / max(1.0, length(wanted)))
    foresee(team, me)
    discs = work.discs[: surround(team, me, mates, row, work.discs)]
    velocity, _ = safe_velocity(me, discs, wanted, work.plays)
    speed, omega = make_up(team, me, *regulate(me, velocity, 0.0))
    write_motion(action, speed, omega, me.max_speed, me.max_omega)
    me.step += 1


propose_all, carry_out_all, guard_all = for_each(propose), for_each(carry_out), for_each(guard)
