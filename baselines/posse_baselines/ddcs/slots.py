"""Who goes to which slot: everyone works out the assignment of all it knows, and takes its part.

Those who know the same come to the same result. Where they do not, as when messages are lost, the
slots that trackers say they hold count for them (``loyalty``), and two that hold the same one are
told apart by who is sooner there.
"""

from __future__ import annotations

import math

import numpy as np

from posse.numeric import FloatArray, Record, Records, compiled
from posse_baselines.ddcs.monitoring import is_there, mate_now
from posse_baselines.laws.assignment import assign
from posse_baselines.laws.geometry import length
from posse_baselines.laws.slots import rotate
from posse_baselines.laws.steering import intercept_time

_HALF_TURN = 0.25 * math.pi  # of the turning time, per 1 - cos
_BIT = np.uint64(1)
_NO_BITS = np.uint64(0)
_RESERVED = 1e4  # s; what a slot costs that belongs to another


@compiled
def slot_place(d: Record, slot: Record) -> tuple[float, float, float, float]:
    """Return a slot's place now (x, y) and its arm from the target (x, y), common frame, m."""
    arm_x, arm_y = rotate(slot.x, slot.y, d.frame_cos, d.frame_sin)
    return d.now_x + arm_x, d.now_y + arm_y, arm_x, arm_y


@compiled(seldom=True)
def choose_slot(
    f: Record,
    s: Record,
    d: Record,
    mates: Records,
    slots: Records,
    own: int,
    x: float,
    y: float,
    heading_c: float,
    heading_s: float,
    max_speed: float,
    max_omega: float,
    cost: FloatArray,
    work: FloatArray,
) -> None:
    """Set the slot of a mind: its part of the assignment that has all arrive soonest in total."""
    n = len(slots)
    if s.radio == 0:
        d.slot = own  # nobody to ask
        return
    rows, mine = 0, 0
    vx, vy = d.speed_x, d.speed_y
    for j in range(n):
        if j == own:
            mine = rows
            held, at_x, at_y = d.slot, x, y
            ahead_x, ahead_y = heading_c, heading_s
        elif is_there(f, s, d, mates[j], n):
            held = mates[j].slot
            ahead_x, ahead_y = float(mates[j].heading_cos), float(mates[j].heading_sin)
            at_x, at_y = mate_now(f, s, d, mates[j])
        elif f.neighbours < n - 1 and mates[j].slot >= 0:
            # No place for it in the observation, but it said which slot is its own. Were it there
            # still, and near, it would have a place.
            slot_x, slot_y, _, _ = slot_place(d, slots[mates[j].slot])
            if length(slot_x - x, slot_y - y) < d.horizon - s.in_place:
                mates[j].slot = -1
                continue
            for k in range(n):
                cost[rows, k] = 0.0 if k == mates[j].slot else _RESERVED
            rows += 1
            continue
        else:
            continue
        for k in range(n):
            slot = slots[k]
            place_x, place_y, _, _ = slot_place(d, slot)
            dx, dy = place_x - at_x, place_y - at_y
            time = intercept_time(dx, dy, vx, vy, max_speed)
            if time > s.weave_time:
                time = intercept_time(dx, dy, d.mean_x, d.mean_y, max_speed)
            # Turning towards it takes time, too; up to half a turn where it lies behind.
            facing = (dx * ahead_x + dy * ahead_y) / max(length(dx, dy), 1e-6)
            time += _HALF_TURN * (1.0 - facing) / max_omega * min(1.0, time)
            if held == k:
                time -= s.loyalty
            if j == own and d.taken & (_BIT << np.uint64(k)) != _NO_BITS:
                time += s.taken_cost
            # Where there are more slots than trackers, those that see the target are filled first.
            if slot.x * slot.x + slot.y * slot.y < (s.in_sight * f.sight) ** 2:
                time -= s.sight_worth
            # The centralized model's leader has the first slot to itself.
            if s.model == 1 and d.leader >= 0 and (k == 0) != (j == d.leader):
                time += _RESERVED
            cost[rows, k] = time + 1e-4 * j
        rows += 1
    assign(cost, rows, n, work)
    if loses_slot(f, s, d, mates, slots, own, int(work[0, mine]), x, y):
        cost[mine, int(work[0, mine])] = _RESERVED
        assign(cost, rows, n, work)
    d.slot = int(work[0, mine])


@compiled
def loses_slot(
    f: Record,
    s: Record,
    d: Record,
    mates: Records,
    slots: Records,
    own: int,
    slot: int,
    x: float,
    y: float,
) -> bool:
    """Say whether a team-mate that says it holds a slot has the better right to it.

    The nearer one; of two that are equally near, the one of the lower number. Both come to the same
    answer, though each may know of others that the other does not.
    """
    slot_x, slot_y, _, _ = slot_place(d, slots[slot])
    mine = length(slot_x - x, slot_y - y)
    for j in range(len(mates)):
        if j != own and mates[j].slot == slot and is_there(f, s, d, mates[j], len(mates)):
            at_x, at_y = mate_now(f, s, d, mates[j])
            other = length(slot_x - at_x, slot_y - at_y)
            if other < mine - s.equally_near or (other < mine + s.equally_near and j < own):
                return bool(d.slot == slot)
    return False
