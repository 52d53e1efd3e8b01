"""Distributed slot assignment: each tracker assigns all known trackers and takes its own slot.

Trackers with equal knowledge get equal results. Otherwise, for example after lost messages, slots
claimed in messages are respected (``loyalty``), and of two trackers that claim one slot the nearer
one keeps it.
"""

from __future__ import annotations

import math

import numpy as np

from posse.numeric import Record, Records, compiled
from posse_baselines.ddcs.memory import Team, Work
from posse_baselines.ddcs.monitoring import is_there, mate_now
from posse_baselines.ddcs.settings import CENTRALIZED
from posse_baselines.laws.assignment import assign
from posse_baselines.laws.geometry import length
from posse_baselines.laws.slots import rotate
from posse_baselines.laws.steering import time_to_slot

_HALF_TURN = 0.25 * math.pi  # of the turning time, per 1 - cos
_BIT = np.uint64(1)
_NO_BITS = np.uint64(0)
_RESERVED = 1e4  # s; cost of a slot claimed by another


@compiled
def slot_place(me: Record, slot: Record) -> tuple[float, float, float, float]:
    """Return a slot's position (x, y) and its offset from the target (x, y), common frame, m."""
    arm_x, arm_y = rotate(slot.x, slot.y, me.frame_cos, me.frame_sin)
    return me.target_x + arm_x, me.target_y + arm_y, arm_x, arm_y


@compiled(out_of_line=True)
def choose_slot(team: Team, me: Record, mates: Records, work: Work) -> None:
    """Set the own slot by the assignment of least total arrival time."""
    at, world, settings = team.at, team.world, team.settings
    n = len(team.slots)
    if settings.radio == 0:
        me.slot = me.number  # no team-mates
        return
    rows, mine = 0, 0
    vx, vy = me.target_vx, me.target_vy
    for j in range(n):
        if j == me.number:
            mine = rows
            held, at_x, at_y = me.slot, me.x, me.y
            ahead_x, ahead_y = me.heading_cos, me.heading_sin
        elif is_there(team, me, mates[j]):
            held = mates[j].slot
            ahead_x, ahead_y = float(mates[j].heading_cos), float(mates[j].heading_sin)
            at_x, at_y = mate_now(team, me, mates[j])
        elif at.neighbours < n - 1 and mates[j].slot >= 0:
            # It has no place in the observation but claimed a slot. If it were still near its
            # slot, and the slot were near, it would have a place.
            slot_x, slot_y, _, _ = slot_place(me, team.slots[mates[j].slot])
            if length(slot_x - me.x, slot_y - me.y) < me.horizon - settings.in_place:
                mates[j].slot = -1
                continue
            for k in range(n):
                work.cost[rows, k] = 0.0 if k == mates[j].slot else _RESERVED
            rows += 1
            continue
        else:
            continue
        for k in range(n):
            slot = team.slots[k]
            place_x, place_y, _, _ = slot_place(me, slot)
            dx, dy = place_x - at_x, place_y - at_y
            time = time_to_slot(dx, dy, vx, vy, me.mean_vx, me.mean_vy, settings.weave_time, me.max_speed)
            # Time for turning towards it, up to half a turn.
            facing = (dx * ahead_x + dy * ahead_y) / max(length(dx, dy), 1e-6)
            time += _HALF_TURN * (1.0 - facing) / me.max_omega * min(1.0, time)
            if held == k:
                time -= settings.loyalty
            if j == me.number and me.taken & (_BIT << np.uint64(k)) != _NO_BITS:
                time += settings.taken_cost
            # With more slots than trackers, those that see the target are filled first.
            if slot.x * slot.x + slot.y * slot.y < (settings.in_sight * world.sight) ** 2:
                time -= settings.sight_worth
            # The leader of the centralized model takes the first slot.
            if settings.model == CENTRALIZED and me.leader >= 0 and (k == 0) != (j == me.leader):
                time += _RESERVED
            work.cost[rows, k] = time + 1e-4 * j
        rows += 1
    assign(work.cost, rows, n, work.assigning)
    if loses_slot(team, me, mates, int(work.assigning[0, mine])):
        work.cost[mine, int(work.assigning[0, mine])] = _RESERVED
        assign(work.cost, rows, n, work.assigning)
    me.slot = int(work.assigning[0, mine])


@compiled
def loses_slot(team: Team, me: Record, mates: Records, slot: int) -> bool:
    """Return whether a team-mate that claims a slot has precedence.

    The nearer one has; for equal distances the lower number. Both trackers get the same result,
    whatever else they know.
    """
    settings = team.settings
    slot_x, slot_y, _, _ = slot_place(me, team.slots[slot])
    mine = length(slot_x - me.x, slot_y - me.y)
    for j in range(len(mates)):
        if j != me.number and mates[j].slot == slot and is_there(team, me, mates[j]):
            at_x, at_y = mate_now(team, me, mates[j])
            other = length(slot_x - at_x, slot_y - at_y)
            if other < mine - settings.equally_near or (other < mine + settings.equally_near and j < me.number):
                return bool(me.slot == slot)
    return False
