"""A control step of the DDCS: monitoring and tracking (:func:`plan`), then actuation (:func:`carry_out`).

Between the two, a wanted velocity may be corrected. The correction comes before the safeguard, so that a corrected
team avoids contact as well as the team itself does.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from posse.numeric import FloatArray, Record, Records, compiled, kernel
from posse_baselines.ddcs.belief import write_belief
from posse_baselines.ddcs.detour import detour
from posse_baselines.ddcs.leadership import settle_lead
from posse_baselines.ddcs.memory import Team, Work, read_body
from posse_baselines.ddcs.messages import write_message
from posse_baselines.ddcs.monitoring import update_mates, watch_target
from posse_baselines.ddcs.motion import command, update_error, wanted_motion
from posse_baselines.ddcs.searching import begin_search, look_around, wander
from posse_baselines.ddcs.settings import CENTRALIZED, FLOCKING, SEARCHING
from posse_baselines.ddcs.slots import choose_slot
from posse_baselines.ddcs.surroundings import surround
from posse_baselines.ddcs.tasks import next_task
from posse_baselines.laws.geometry import length
from posse_baselines.laws.heading import regulate
from posse_baselines.laws.safeguard import safe_velocity
from posse_baselines.laws.steering import write_motion


@compiled
def plan(team: Team, me: Record, mates: Records, seen: npt.NDArray[np.uint16], row: FloatArray, work: Work) -> None:
    """Monitor and track: set the wanted velocity of one tracker for its observation (F,)."""
    read_body(team, me, row)
    # Monitoring
    watch_target(team, me, row)
    update_mates(team, me, mates, row)
    look_around(team, me, mates, seen)
    # Tracking
    if team.settings.model == CENTRALIZED:
        settle_lead(team, me, mates)
    me.closing = 0
    if me.known == 0:
        me.slot, me.error = -1, -1.0
        if me.task != SEARCHING:
            begin_search(team, me, seen)
    else:
        if me.slot < 0 or me.step % max(1, round(team.settings.replan_time / team.world.dt)) == 0:
            choose_slot(team, me, mates, work)
        update_error(team, me, mates)
    me.task = next_task(team, me)
    if me.task == SEARCHING or me.slot < 0:
        vx, vy = wander(team, me, mates, seen)
        vx, vy, speed, omega = command(me, vx, vy, 0.0)
    else:
        vx, vy, speed, omega = wanted_motion(team, me, mates)
    me.wish_x, me.wish_y, me.wish_speed, me.wish_omega = vx, vy, speed, omega


@compiled
def correct(me: Record, ahead: float, left: float) -> None:
    """Add to the wanted velocity, in shares of the greatest speed, which also limits the sum.

    The command changes by what regulation of the two velocities differs by, so that a small
    correction changes little, whatever law the command came from.
    """
    if ahead == 0.0 and left == 0.0:
        return
    cosine, sine, top = me.heading_cos, me.heading_sin, me.max_speed
    x = me.wish_x + top * (ahead * cosine - left * sine)
    y = me.wish_y + top * (ahead * sine + left * cosine)
    excess = max(1.0, length(x, y) / max(top, length(me.wish_x, me.wish_y)))
    x, y = x / excess, y / excess
    old_speed, old_omega = regulate(me, me.wish_x, me.wish_y, 0.0)
    speed, omega = regulate(me, x, y, 0.0)
    me.wish_x, me.wish_y = x, y
    me.wish_speed += speed - old_speed
    me.wish_omega += omega - old_omega


@compiled
def carry_out(team: Team, me: Record, mates: Records, row: FloatArray, work: Work, action: FloatArray) -> None:
    """Actuate: write the action (2 + m,) of one tracker that realises its wanted velocity."""
    vx, vy, speed, omega = me.wish_x, me.wish_y, me.wish_speed, me.wish_omega
    count = surround(team, me, mates, row, work.discs)
    turned = False
    if team.settings.detour > 0.0 and me.task != FLOCKING:
        wanted_x, wanted_y = vx, vy
        vx, vy = detour(team, me, work.discs, count, vx, vy)
        turned = vx != wanted_x or vy != wanted_y
    vx, vy, changed = safe_velocity(me, work.discs, count, vx, vy, work.plays)
    if changed or turned:
        speed, omega = regulate(me, vx, vy, 0.0)
    write_motion(action, speed, omega, me.max_speed, me.max_omega)
    write_message(me, action)
    me.step += 1


@kernel
def propose_all(
    teams: Team,
    minds: Records,
    mates: Records,
    seen: npt.NDArray[np.uint16],
    observations: FloatArray,
    work: Work,
    proposals: FloatArray,
    thread: int,
    first: int,
    end: int,
) -> None:
    """Plan in a share of worlds; write the wanted velocities (E, N, 2), ahead and left, in shares of the top speed."""
    team = Team(teams.at[0], teams.world[0], teams.settings[0], teams.slots, teams.outermost, teams.beams)
    mine = Work(work.cost[thread], work.assigning[thread], work.discs[thread], work.plays[thread])
    for e in range(first, end):
        for i in range(observations.shape[1]):
            me, proposal = minds[e, i], proposals[e, i]
            plan(team, me, mates[e, i], seen[e, i], observations[e, i], mine)
            cosine, sine = me.heading_cos, me.heading_sin
            proposal[0] = (me.wish_x * cosine + me.wish_y * sine) / me.max_speed
            proposal[1] = (me.wish_y * cosine - me.wish_x * sine) / me.max_speed


@kernel
def carry_out_all(
    teams: Team,
    minds: Records,
    mates: Records,
    observations: FloatArray,
    work: Work,
    corrections: FloatArray,
    actions: FloatArray,
    thread: int,
    first: int,
    end: int,
) -> None:
    """Carry out the corrected plans of a share of the worlds."""
    team = Team(teams.at[0], teams.world[0], teams.settings[0], teams.slots, teams.outermost, teams.beams)
    mine = Work(work.cost[thread], work.assigning[thread], work.discs[thread], work.plays[thread])
    for e in range(first, end):
        for i in range(observations.shape[1]):
            correct(minds[e, i], float(corrections[e, i, 0]), float(corrections[e, i, 1]))
            carry_out(team, minds[e, i], mates[e, i], observations[e, i], mine, actions[e, i])


@kernel
def write_beliefs(
    teams: Team,
    minds: Records,
    mates: Records,
    seen: npt.NDArray[np.uint16],
    beliefs: FloatArray,
    thread: int,
    first: int,
    end: int,
) -> None:
    """Write the beliefs (E, N, BELIEF_SIZE) of a share of the worlds."""
    team = Team(teams.at[0], teams.world[0], teams.settings[0], teams.slots, teams.outermost, teams.beams)
    for e in range(first, end):
        for i in range(minds.shape[1]):
            write_belief(team, minds[e, i], mates[e, i], seen[e, i], beliefs[e, i])
