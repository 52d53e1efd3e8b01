"""Distributed slot assignment: each tracker assigns all known trackers and takes its own slot.

Trackers with equal knowledge get equal results. Otherwise, for example after lost messages, slots
claimed in messages are respected (``loyalty``), and of two trackers that claim one slot the nearer
one keeps it.
"""

from __future__ import annotations

import math

import numpy as np

from posse.numeric import FloatArray, Record, Records, compiled
from posse_baselines.ddcs.monitoring import is_there, mate_now
from posse_baselines.laws.assignment import assign
from posse_baselines.laws.geometry import length
from posse_baselines.laws.slots import rotate
from posse_baselines.laws.steering import time_to_slot

_HALF_TURN = 0.25 * math.pi  # of the turning time, per 1 - cos
_BIT = np.uint64(1)
_NO_BITS = np.uint64(0)
_RESERVED = 1e4  # s; cost of a slot claimed by another


@compiled
def slot_place(d: Record, slot: Record) -> tuple[float, float, float, float]:
    """Return a slot's position (x, y) and its offset from the target (x, y), common frame, m."""
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
    """Set the own slot by the assignment of least total arrival time."""
    n = len(slots)
    if s.radio == 0:
        d.slot = own  # no team-mates
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
            # It has no place in the observation but claimed a slot. If it were still near its
            # slot, and the slot were near, it would have a place.
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
            time = time_to_slot(dx, dy, vx, vy, d.mean_x, d.mean_y, s.weave_time, max_speed)
            # Time for turning towards it, up to half a turn.
            facing = (dx * ahead_x + dy * ahead_y) / max(length(dx, dy), 1e-6)
            time += _HALF_TURN * (1.0 - facing) / max_omega * min(1.0, time)
            if held == k:
                time -= s.loyalty
            if j == own and d.taken & (_BIT << np.uint64(k)) != _NO_BITS:
                time += s.taken_cost
            # With more slots than trackers, those that see the target are filled first.
            if slot.x * slot.x + slot.y * slot.y < (s.in_sight * f.sight) ** 2:
                time -= s.sight_worth
            # The leader of the centralized model takes the first slot.
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
    f: Record, s: Record, d: Record, mates: Records, slots: Records, own: int, slot: int, x: float, y: float
) -> bool:
    """Return whether a team-mate that claims a slot has precedence.

    The nearer one has; for equal distances the lower number. Both trackers get the same result,
    whatever else they know.
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
