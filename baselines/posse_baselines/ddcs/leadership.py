"""Who leads: the nearest-neighbour rule of section 3.5, agreed on without a referee.

A claim is a pair (term, leader). Everyone says which claim it holds and takes over a better one
that it hears: the higher term; of equal terms, the leader of the lower number. Only two things make
a new term: the leader finds another clearly nearer to the target and hands over, or a tracker has
not heard of the leader for too long and appoints the nearest one that it knows. So the whole of a
radio graph comes to hold one claim, and two parts that meet again agree on the higher one.

A leader counts its steps aloud, and the others pass the highest count on. That is how a tracker
several hops away knows that the leader is alive.
"""

from __future__ import annotations

from posse.numeric import Record, Records, compiled
from posse_baselines.ddcs.messages import COUNT, is_newer
from posse_baselines.ddcs.monitoring import is_there, mate_now, patience
from posse_baselines.laws.guidance import length


@compiled
def better_claim(term: int, leader: int, old_term: int, old_leader: int) -> bool:
    """Say whether a claim (term, leader) wins over another; -1 is no leader."""
    if leader < 0:
        return False
    if old_leader < 0 or is_newer(term, old_term):
        return True
    return term == old_term and leader < old_leader


@compiled
def appoint(d: Record, leader: int, term: int, pulse: int) -> None:
    """Hold a claim from now on."""
    if d.leader >= 0 and leader != d.leader:
        d.exchanges += 1
    if leader != d.leader:
        d.confirmed = 0
    d.leader, d.term, d.pulse, d.pulse_step = leader, term, pulse, d.step


@compiled
def nearest_tracker(
    f: Record, s: Record, d: Record, mates: Records, own: int, x: float, y: float, barred: int
) -> tuple[int, float, float]:
    """Return who is nearest to the target, how near, and the own distance (m).

    Of all that count as working, ``barred`` excepted (-1: nobody).
    """
    own_distance = length(d.now_x - x, d.now_y - y)
    best, least = own, own_distance
    for j in range(len(mates)):
        if j != own and j != barred and is_there(f, s, d, mates[j], len(mates)):
            mate_x, mate_y = mate_now(f, s, d, mates[j])
            distance = length(d.now_x - mate_x, d.now_y - mate_y)
            if distance < least:
                best, least = j, distance
    return best, least, own_distance


@compiled
def settle_lead(
    f: Record, s: Record, d: Record, mates: Records, own: int, x: float, y: float
) -> None:
    """Hear the others' claims, hand over or appoint if it is time to; (x, y) is the own place."""
    for j in range(len(mates)):
        mate = mates[j]
        if mate.fresh == 0 or mate.leader < 0:
            continue
        if mate.leader == d.leader and mate.term == d.term:
            if is_newer(mate.pulse, d.pulse):
                d.pulse, d.pulse_step = mate.pulse, d.step
                d.confirmed = 1
        elif better_claim(mate.term, mate.leader, d.term, d.leader):
            appoint(d, mate.leader, mate.term, mate.pulse)
    if d.leader == own:
        d.pulse, d.pulse_step, d.confirmed = (d.pulse + 1) % COUNT, d.step, 1
    if d.known == 0:
        return
    if d.leader < 0:
        best, _, _ = nearest_tracker(f, s, d, mates, own, x, y, -1)
        appoint(d, best, 1, 0)
        return
    if not s.exchange:
        return
    if d.leader == own:
        if d.step % max(1, round(s.time_lag / f.dt)) == 0:
            best, least, distance = nearest_tracker(f, s, d, mates, own, x, y, -1)
            if best != own and least < distance - s.lead_hysteresis:
                appoint(d, best, (d.term + 1) % COUNT, 0)
    elif (d.step - d.pulse_step) * f.dt > patience(s, d) + 0.2:
        best, _, _ = nearest_tracker(f, s, d, mates, own, x, y, d.leader)
        appoint(d, best, (d.term + 1) % COUNT, 0)
