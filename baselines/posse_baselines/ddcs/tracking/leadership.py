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
from posse_baselines.ddcs.memory import EXCHANGING, SEARCHING
from posse_baselines.ddcs.messages import COUNT, is_newer
from posse_baselines.ddcs.monitoring import is_there, mate_now, patience
from posse_baselines.ddcs.tracking.tasks import may_change
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
def appoint(d: Record, leader: int, term: int, pulse: int) -> None:
    """Adopt a claim."""
    if d.leader >= 0 and leader != d.leader:
        d.exchanges += 1
    if leader != d.leader:
        d.confirmed = 0
    d.leader, d.term, d.pulse, d.pulse_step = leader, term, pulse, d.step


@compiled
def nearest_tracker(
    f: Record, s: Record, d: Record, mates: Records, own: int, x: float, y: float, barred: int
) -> tuple[int, float, float]:
    """Return the tracker nearest to the target, its distance, and the own distance (m).

    Among all that count as working, except ``barred`` (-1: none).
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
def place_of(
    f: Record, s: Record, d: Record, mates: Records, own: int, x: float, y: float, j: int
) -> tuple[float, float]:
    """Return the current position of tracker j, m; (x, y) is the own one."""
    return (x, y) if j == own else mate_now(f, s, d, mates[j])


@compiled(seldom=True)
def central_tracker(f: Record, s: Record, d: Record, mates: Records, own: int, x: float, y: float) -> tuple[int, int]:
    """Return the tracker with the least sum of distances to all heard, and their number."""
    n, others = len(mates), 0
    best, least = own, 1e30
    for i in range(n):
        if i != own:
            if not is_there(f, s, d, mates[i], n):
                continue
            others += 1
        x_i, y_i = place_of(f, s, d, mates, own, x, y, i)
        total = 0.0
        for j in range(n):
            if j != i and (j == own or is_there(f, s, d, mates[j], n)):
                x_j, y_j = place_of(f, s, d, mates, own, x, y, j)
                total += length(x_i - x_j, y_i - y_j)
        # Ties within rounding go to the lower number.
        if total < least - 1e-3:
            best, least = i, total
    return best, others


@compiled
def select_leader(f: Record, s: Record, d: Record, mates: Records, own: int, x: float, y: float, barred: int) -> None:
    """Appoint a tracker other than ``barred`` (-1: any) under a new term."""
    if d.known:
        best, _, _ = nearest_tracker(f, s, d, mates, own, x, y, barred)
        appoint(d, best, (d.term + 1) % COUNT, 0)
        return
    best, others = central_tracker(f, s, d, mates, own, x, y)
    if others == 0:
        appoint(d, own, (d.term - 1) % COUNT, 0)
    else:
        appoint(d, best if best != barred else own, (d.term + 1) % COUNT, 0)


@compiled
def settle_lead(f: Record, s: Record, d: Record, mates: Records, own: int, x: float, y: float) -> None:
    """Process received claims; hand over or appoint if due; (x, y) is the own position."""
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
    if d.leader < 0:
        select_leader(f, s, d, mates, own, x, y, -1)
        return
    # In the search there are no followers, and leadership changes without the exchange task.
    if d.task != SEARCHING and not may_change(s, d.task, EXCHANGING):
        return
    if d.leader == own:
        if d.known and d.step % max(1, round(s.time_lag / f.dt)) == 0:
            best, least, distance = nearest_tracker(f, s, d, mates, own, x, y, -1)
            if best != own and least < distance - s.lead_hysteresis:
                appoint(d, best, (d.term + 1) % COUNT, 0)
    elif (d.step - d.pulse_step) * f.dt > patience(s, d) + s.lead_patience:
        select_leader(f, s, d, mates, own, x, y, d.leader)
