"""What the trackers agree on: who leads (section 3.5), and who takes which slot.

**Leader** (centralized model). A claim is a pair (term, leader). Every tracker broadcasts the claim that it holds and
adopts a better one that it receives: the higher term; for equal terms, the lower leader number. Two events create a
higher term: the leader finds another tracker clearly nearer to the target and hands over (the nearest-neighbour rule,
every time lag), or a tracker has not heard of the leader for too long and appoints the nearest one that it knows. A
connected radio graph thus converges to one claim, and two parts that meet again agree on the higher one.

There is a leader from the first step on: while the target is unknown, every tracker appoints itself, and the lowest
number wins. One that then hears no other leads itself (rule ii) under a lower term, so that it yields when it meets a
group. The leader counts its steps in its message, and the others relay the highest count, so that trackers several hops
away know that the leader is alive.

**Slots.** Each tracker assigns all known trackers and takes its own slot. Trackers with equal knowledge get equal
results. Otherwise, for example after lost messages, slots claimed in messages are respected.
"""

import math
from typing import Final

from posse.numeric import Record, Records, compiled
from posse_baselines.ddcs.memory import Team, is_due, since
from posse_baselines.ddcs.monitoring import COUNT, is_newer
from posse_baselines.ddcs.settings import EXCHANGING, SEARCHING
from posse_baselines.laws.geometry import dot, length, unit
from posse_baselines.laws.steering import Work, assign

REPLAN_TIME: Final = 0.5
"""s. Time between two assignments."""
_IN_PLACE: Final = 0.4  # m; nearer to a slot than this, a tracker is in it
_IN_SIGHT: Final = 0.95  # share of the range of sight within which a slot counts as seeing the target
_SIGHT_WORTH: Final = 10.0  # s; bonus of such a slot, as arrival time
_LOYALTY: Final = 0.6  # s; least gain in total arrival time for a change of slots
_RESERVED: Final = 1e4  # s; cost of a slot claimed by another
_HALF_TURN: Final = 0.25 * math.pi  # of the turning time, per 1 - cos


@compiled
def appoint(me: Record, leader: int, term: int, pulse: int) -> None:
    """Adopt a claim."""
    if leader != me.leader:
        me.confirmed = 0
        if me.leader >= 0:
            me.exchanges += 1
    me.leader, me.term, me.pulse, me.pulse_step = leader, term, pulse, me.step


@compiled
def nearest_tracker(me: Record, mates: Records) -> tuple[int, float]:
    """Return the working tracker nearest to the target, this one or one that does not lead, and its distance."""
    best, least = me.number, length(me.target - me.position)
    for j in range(len(mates)):
        if j != me.leader and mates[j].there:
            distance = length(me.target - mates[j].place)
            if distance < least:
                best, least = j, distance
    return best, least


@compiled
def select_leader(me: Record, mates: Records) -> None:
    """Appoint a tracker other than the leader under a new term."""
    best, term = int(me.number), me.term + 1
    if me.known:
        best, _ = nearest_tracker(me, mates)
    elif me.others == 0:
        term = me.term - 1
    appoint(me, best, term % COUNT, 0)


@compiled
def settle_lead(team: Team, me: Record, mates: Records) -> None:
    """Process received claims; hand over or appoint if due."""
    settings = team.settings
    for j in range(len(mates)):
        mate = mates[j]
        if mate.heard != me.step or mate.leader < 0:
            continue
        if mate.leader == me.leader and mate.term == me.term:
            if is_newer(mate.pulse, me.pulse):
                me.pulse, me.pulse_step, me.confirmed = mate.pulse, me.step, 1
        elif me.leader < 0 or is_newer(mate.term, me.term) or (mate.term == me.term and mate.leader < me.leader):
            appoint(me, mate.leader, mate.term, mate.pulse)
    if me.leader == me.number:
        me.pulse, me.pulse_step, me.confirmed = (me.pulse + 1) % COUNT, me.step, 1
    if me.leader < 0:
        select_leader(me, mates)
        return
    # In the search there are no followers, and leadership changes without the exchange task.
    if me.task != SEARCHING and settings.forbidden[me.task, EXCHANGING]:
        return
    if me.leader == me.number:
        if me.known and is_due(team, me, settings.time_lag):
            best, least = nearest_tracker(me, mates)
            if best != me.number and least < length(me.target - me.position) - settings.lead_hysteresis:
                appoint(me, best, (me.term + 1) % COUNT, 0)
    elif since(team, me, me.pulse_step) > team.world.patience + settings.lead_patience:
        select_leader(me, mates)


@compiled
def slot_cost(team: Team, me: Record, position: complex, heading: complex, k: int) -> float:
    """Return the time (s) that a tracker takes to slot k, less what the slot is worth."""
    slot = team.slots[k]
    way = me.target + slot * me.frame - position
    time = length(way) / me.max_speed
    # Time for turning towards it, up to half a turn.
    facing = dot(unit(way), heading)
    time += _HALF_TURN * (1.0 - facing) / me.max_omega * min(1.0, time)
    # With more slots than trackers, those that see the target are filled first.
    if dot(slot, slot) < (_IN_SIGHT * team.world.sight) ** 2:
        time -= _SIGHT_WORTH
    return float(time)


@compiled
def choose_slot(team: Team, me: Record, mates: Records, work: Work) -> None:
    """Set the own slot by the assignment of least total arrival time."""
    settings, n, cost = team.settings, len(team.slots), work.cost
    if settings.radio == 0:
        me.slot = me.number  # no team-mates
        return
    cost[:] = 0.0  # of one that is not there: it takes what is left over
    for j in range(n):
        mate = mates[j]
        if j != me.number and mate.there == 0:
            if team.world.unlisted != 0 and mate.slot >= 0:
                # It has no place in the observation but claimed a slot. If it were still near its
                # slot, and the slot were near, it would have a place.
                place = me.target + team.slots[mate.slot] * me.frame
                if length(place - me.position) < me.horizon - _IN_PLACE:
                    mate.slot = -1
                else:
                    cost[j] = _RESERVED
                    cost[j, mate.slot] = 0.0
            continue
        held, heading = (me.slot, me.heading) if j == me.number else (mate.slot, mate.heading)
        for k in range(n):
            time = slot_cost(team, me, mate.place, heading, k)
            if held == k:
                time -= _LOYALTY
            # The leader of the centralized model takes the first slot.
            if settings.centralized and me.leader >= 0 and (k == 0) != (j == me.leader):
                time += _RESERVED
            cost[j, k] = time + 1e-4 * j * k / n  # so all choose the same of equal assignments
    assign(cost, work.assigning)
    me.slot = int(work.assigning[0, me.number])
