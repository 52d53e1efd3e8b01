"""What a tracker believes, as numbers that a network can read.

All vectors are relative to the tracker: x ahead, y to the left. A length d is scaled to
d / (d + scale), which resolves both centimetres and tens of metres.
"""

from __future__ import annotations

import math
from typing import Final

from posse.numeric import FloatArray, Record, Records, compiled
from posse_baselines.ddcs.memory import GRID, Seen, Team, Work, for_each
from posse_baselines.ddcs.monitoring import is_there, mate_now
from posse_baselines.ddcs.motion import age_of
from posse_baselines.ddcs.settings import SEARCHING
from posse_baselines.laws.geometry import length, scaled, vector
from posse_baselines.laws.steering import slot_velocity

MATES: Final = 3
"""Team-mates in a belief: those that are nearest by its estimate of where they are now."""
LOOKS: Final = 8
"""Directions in which a belief says when the team last looked, from ahead to the left."""
TARGET_AT: Final = 0
"""Known (0 or 1), position / (d + 3 m), velocity (m/s), cosine and sine of the slot frame, its turn
rate (rad/s), age / (age + 1 s): 9 numbers, 0 while there is no estimate."""
TASK_AT: Final = 9
"""One number for each task, 1 for the present one."""
SLOT_AT: Final = 13
"""Has a slot (0 or 1), the way to it / (d + 0.3 m) and / (d + 3 m), its velocity (m/s)."""
SEARCH_AT: Final = 20
"""While searching: time since the target was lost / (t + 10 s), the way to the goal / (d + 3 m)."""
MATES_AT: Final = 23
"""Share of the team that counts as present; the positions of the nearest ones / (d + 1 m)."""
LOOKS_AT: Final = MATES_AT + 1 + 2 * MATES
"""Time since the place one sensing range away was last covered, 1: long ago."""
BELIEF_SIZE: Final = LOOKS_AT + LOOKS
"""Numbers in a belief."""

_NEAR: Final = 0.3  # m
_FAR: Final = 3.0  # m
_BESIDE: Final = 1.0  # m
_LOST: Final = 10.0  # s


@compiled
def put(me: Record, v: complex, out: FloatArray) -> None:
    """Write a vector of the common axes as it lies to the tracker."""
    own = v * me.heading.conjugate()
    out[0], out[1] = own.real, own.imag


@compiled
def put_soft(me: Record, v: complex, scale: float, out: FloatArray) -> None:
    """Write a vector (m) as it lies to the tracker, its length scaled."""
    own = scaled(v * me.heading.conjugate(), 1.0 / (length(v) + scale))
    out[0], out[1] = own.real, own.imag


@compiled
def believe(team: Team, me: Record, mates: Records, seen: Seen, row: FloatArray, work: Work, out: FloatArray) -> None:
    """Write the belief (BELIEF_SIZE,) of one tracker after it planned; ``out`` is 0 before."""
    if me.known != 0:
        b = out[TARGET_AT:]
        b[0] = 1.0
        put_soft(me, me.target - me.position, _FAR, b[1:])
        put(me, me.target_velocity, b[3:])
        put(me, me.frame, b[5:])
        b[7] = me.psi_rate
        b[8] = me.fix_age / (me.fix_age + 1.0)
    out[TASK_AT + me.task] = 1.0
    if me.slot >= 0:
        b = out[SLOT_AT:]
        arm = team.slots[me.slot] * me.frame
        way = me.target + arm - me.position
        b[0] = 1.0
        put_soft(me, way, _NEAR, b[1:])
        put_soft(me, way, _FAR, b[3:])
        put(me, slot_velocity(me.target_velocity, me.psi_rate, arm), b[5:])
    if me.task == SEARCHING:
        b = out[SEARCH_AT:]
        lost = float(me.step - max(0, me.lost_step)) * team.world.dt
        b[0] = lost / (lost + _LOST)
        if me.goal_step >= 0:
            put_soft(me, me.goal - me.position, _FAR, b[1:])
    _write_mates(team, me, mates, out[MATES_AT:])
    if len(seen) > 0:
        _write_looks(team, me, seen, out[LOOKS_AT:])


@compiled
def _write_mates(team: Team, me: Record, mates: Records, out: FloatArray) -> None:
    """Write the share of team-mates that are there, and the nearest ones in order."""
    there, last, last_j = 0, -1.0, -1
    for j in range(len(mates)):
        if is_there(team, me, mates[j]):
            there += 1
    out[0] = there / max(1.0, len(mates) - 1.0)
    for k in range(min(there, MATES)):
        least, best, nearest = 1e9, -1, 0j
        for j in range(len(mates)):
            if is_there(team, me, mates[j]):
                way = mate_now(team, me, mates[j])[0] - me.position
                away = length(way)
                if (away > last or (away == last and j > last_j)) and away < least:
                    least, best, nearest = away, j, way
        if best < 0:
            break
        put_soft(me, nearest, _BESIDE, out[1 + 2 * k :])
        last, last_j = least, best


@compiled
def _write_looks(team: Team, me: Record, seen: Seen, out: FloatArray) -> None:
    """Write how long ago the team covered the places around; 0 beyond the area."""
    world = team.world
    scale_x, scale_y = GRID / (2.0 * world.area_x), GRID / (2.0 * world.area_y)
    for k in range(LOOKS):
        there = me.position + scaled(vector(1.0, 2.0 * math.pi * k / LOOKS) * me.heading, world.sight) - me.area
        i = math.floor((there.real + world.area_x) * scale_x)
        j = math.floor((there.imag + world.area_y) * scale_y)
        if 0 <= i < GRID and 0 <= j < GRID:
            out[k] = age_of(team, me, seen, i, j, False) / team.settings.stale_after


believe_all = for_each(believe)
