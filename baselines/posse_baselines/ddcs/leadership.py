"""Distributed leader selection and exchange of the centralized model (section 3.5).

A claim is a pair (term, leader). Every tracker broadcasts the claim that it holds and adopts a
better one that it receives: the higher term; for equal terms, the lower leader number. Two events
create a higher term: the leader finds another tracker clearly nearer to the target and hands over
(the nearest-neighbour rule, every time lag), or a tracker has not heard of the leader for too long
and appoints the nearest one that it knows. A connected radio graph thus converges to one claim, and
two parts that meet again agree on the higher one.

There is a leader from the first step on. While the target is unknown, it is the most central
tracker of those that hear each other. A tracker that hears no other leads itself (rule ii) under a
lower term, so that it yields when it meets a group.

The leader counts its steps in its message, and the others relay the highest count, so that trackers
several hops away know that the leader is alive.
"""

from __future__ import annotations

from posse.numeric import Record, Records, compiled
from posse_baselines.ddcs.memory import Team
from posse_baselines.ddcs.messages import COUNT, is_newer
from posse_baselines.ddcs.monitoring import is_there, mate_now, patience
from posse_baselines.ddcs.settings import EXCHANGING, SEARCHING
from posse_baselines.ddcs.tasks import may_change
from posse_baselines.laws.geometry import length


@compiled
def better_claim(term: int, leader: int, old_term: int, old_leader: int) -> bool:
    """Return whether a claim (term, leader) wins over another; -1 is no leader."""
    if leader < 0:
        return False
    if old_leader < 0 or is_newer(term, old_term):
        return True
    return term == old_term and leader < old_leader


@compiled
def appoint(me: Record, leader: int, term: int, pulse: int) -> None:
    """Adopt a claim."""
    if me.leader >= 0 and leader != me.leader:
        me.exchanges += 1
    if leader != me.leader:
        me.confirmed = 0
    me.leader, me.term, me.pulse, me.pulse_step = leader, term, pulse, me.step


@compiled
def nearest_tracker(team: Team, me: Record, mates: Records, barred: int) -> tuple[int, float, float]:
    """Return the tracker nearest to the target, its distance, and the own distance (m).

    Among all that count as working, except ``barred`` (-1: none).
    """
    own_distance = length(me.target_x - me.x, me.target_y - me.y)
    best, least = me.number, own_distance
    for j in range(len(mates)):
        if j != me.number and j != barred and is_there(team, me, mates[j]):
            mate_x, mate_y = mate_now(team, me, mates[j])
            distance = length(me.target_x - mate_x, me.target_y - mate_y)
            if distance < least:
                best, least = j, distance
    return best, least, own_distance


@compiled
def place_of(team: Team, me: Record, mates: Records, j: int) -> tuple[float, float]:
    """Return the current position of tracker j, m; (x, y) is the own one."""
    return (me.x, me.y) if j == me.number else mate_now(team, me, mates[j])


@compiled(out_of_line=True)
def central_tracker(team: Team, me: Record, mates: Records) -> tuple[int, int]:
    """Return the tracker with the least sum of distances to all heard, and their number."""
    n, others = len(mates), 0
    best, least = me.number, 1e30
    for i in range(n):
        if i != me.number:
            if not is_there(team, me, mates[i]):
                continue
            others += 1
        x_i, y_i = place_of(team, me, mates, i)
        total = 0.0
        for j in range(n):
            if j != i and (j == me.number or is_there(team, me, mates[j])):
                x_j, y_j = place_of(team, me, mates, j)
                total += length(x_i - x_j, y_i - y_j)
        # Ties within rounding go to the lower number.
        if total < least - 1e-3:
            best, least = i, total
    return best, others


@compiled
def select_leader(team: Team, me: Record, mates: Records, barred: int) -> None:
    """Appoint a tracker other than ``barred`` (-1: any) under a new term."""
    if me.known:
        best, _, _ = nearest_tracker(team, me, mates, barred)
        appoint(me, best, (me.term + 1) % COUNT, 0)
        return
    best, others = central_tracker(team, me, mates)
    if others == 0:
        appoint(me, me.number, (me.term - 1) % COUNT, 0)
    else:
        appoint(me, best if best != barred else me.number, (me.term + 1) % COUNT, 0)


@compiled
def settle_lead(team: Team, me: Record, mates: Records) -> None:
    """Process received claims; hand over or appoint if due; (x, y) is the own position."""
    world, settings = team.world, team.settings
    for j in range(len(mates)):
        mate = mates[j]
        if mate.fresh == 0 or mate.leader < 0:
            continue
        if mate.leader == me.leader and mate.term == me.term:
            if is_newer(mate.pulse, me.pulse):
                me.pulse, me.pulse_step = mate.pulse, me.step
                me.confirmed = 1
        elif better_claim(mate.term, mate.leader, me.term, me.leader):
            appoint(me, mate.leader, mate.term, mate.pulse)
    if me.leader == me.number:
        me.pulse, me.pulse_step, me.confirmed = (me.pulse + 1) % COUNT, me.step, 1
    if me.leader < 0:
        select_leader(team, me, mates, -1)
        return
    # In the search there are no followers, and leadership changes without the exchange task.
    if me.task != SEARCHING and not may_change(team, me.task, EXCHANGING):
        return
    if me.leader == me.number:
        if me.known and me.step % max(1, round(settings.time_lag / world.dt)) == 0:
            best, least, distance = nearest_tracker(team, me, mates, -1)
            if best != me.number and least < distance - settings.lead_hysteresis:
                appoint(me, best, (me.term + 1) % COUNT, 0)
    elif (me.step - me.pulse_step) * world.dt > patience(team, me) + settings.lead_patience:
        select_leader(team, me, mates, me.leader)
