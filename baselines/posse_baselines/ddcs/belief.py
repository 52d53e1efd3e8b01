"""What a tracker believes, as numbers that a network can read.

All vectors are relative to the tracker: x ahead, y to the left. A length d is scaled to
d / (d + scale), which resolves both centimetres and tens of metres.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from posse.numeric import FloatArray, Record, Records, compiled
from posse_baselines.ddcs.memory import GRID, Team
from posse_baselines.ddcs.monitoring import is_there, mate_now
from posse_baselines.ddcs.searching import age_of
from posse_baselines.ddcs.settings import SEARCHING
from posse_baselines.ddcs.slots import slot_place
from posse_baselines.laws.geometry import length

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
_ZERO: Final = np.float32(0.0)


@compiled
def soft(me: Record, x: float, y: float, scale: float, out: FloatArray) -> None:
    """Write a vector of the common frame (m) relative to the tracker, its length scaled."""
    by = 1.0 / (length(x, y) + scale)
    out[0] = by * (x * me.heading_cos + y * me.heading_sin)
    out[1] = by * (y * me.heading_cos - x * me.heading_sin)


@compiled
def write_belief(team: Team, me: Record, mates: Records, seen: npt.NDArray[np.uint16], out: FloatArray) -> None:
    """Write the belief (BELIEF_SIZE,) of one tracker after it planned."""
    for k in range(BELIEF_SIZE):
        out[k] = _ZERO
    x, y, cosine, sine = me.x, me.y, me.heading_cos, me.heading_sin
    if me.known != 0:
        b = out[TARGET_AT:]
        b[0] = 1.0
        soft(me, me.target_x - x, me.target_y - y, _FAR, b[1:3])
        b[3] = me.target_vx * cosine + me.target_vy * sine
        b[4] = me.target_vy * cosine - me.target_vx * sine
        b[5] = me.frame_cos * cosine + me.frame_sin * sine
        b[6] = me.frame_sin * cosine - me.frame_cos * sine
        b[7] = me.psi_rate
        b[8] = me.fix_age / (me.fix_age + 1.0)
    out[TASK_AT + me.task] = 1.0
    if me.slot >= 0:
        b = out[SLOT_AT:]
        place_x, place_y, arm_x, arm_y = slot_place(me, team.slots[me.slot])
        vx, vy = me.target_vx - me.psi_rate * arm_y, me.target_vy + me.psi_rate * arm_x
        b[0] = 1.0
        soft(me, place_x - x, place_y - y, _NEAR, b[1:3])
        soft(me, place_x - x, place_y - y, _FAR, b[3:5])
        b[5] = vx * cosine + vy * sine
        b[6] = vy * cosine - vx * sine
    if me.task == SEARCHING:
        b = out[SEARCH_AT:]
        lost = float(me.step - max(0, me.lost_step)) * team.world.dt
        b[0] = lost / (lost + _LOST)
        if me.goal_step >= 0:
            soft(me, me.goal_x - x, me.goal_y - y, _FAR, b[1:3])
    _write_mates(team, me, mates, out[MATES_AT:])
    if len(seen) > 0:
        _write_looks(team, me, seen, out[LOOKS_AT:])


@compiled
def _write_mates(team: Team, me: Record, mates: Records, out: FloatArray) -> None:
    """Write the share of team-mates that are there, and the nearest ones in order."""
    there, last, last_j = 0, -1.0, -1
    for j in range(len(mates)):
        if j != me.number and is_there(team, me, mates[j]):
            there += 1
    out[0] = there / max(1.0, len(mates) - 1.0)
    for k in range(min(there, MATES)):
        least, best = 1e9, -1
        for j in range(len(mates)):
            if j == me.number or not is_there(team, me, mates[j]):
                continue
            at_x, at_y = mate_now(team, me, mates[j])
            way = length(at_x - me.x, at_y - me.y)
            after = way > last or (way == last and j > last_j)
            if after and way < least:
                least, best = way, j
        if best < 0:
            break
        at_x, at_y = mate_now(team, me, mates[best])
        soft(me, at_x - me.x, at_y - me.y, _BESIDE, out[1 + 2 * k : 3 + 2 * k])
        last, last_j = least, best


@compiled
def _write_looks(team: Team, me: Record, seen: npt.NDArray[np.uint16], out: FloatArray) -> None:
    """Write how long ago the team covered the places around; 0 beyond the area."""
    world, settings = team.world, team.settings
    scale = GRID / (2.0 * world.area)
    for k in range(LOOKS):
        angle = 2.0 * math.pi * k / LOOKS
        c, n = math.cos(angle), math.sin(angle)
        i = math.floor(
            (me.x + world.sight * (c * me.heading_cos - n * me.heading_sin) - me.area_x + world.area) * scale
        )
        j = math.floor(
            (me.y + world.sight * (c * me.heading_sin + n * me.heading_cos) - me.area_y + world.area) * scale
        )
        if 0 <= i < GRID and 0 <= j < GRID:
            out[k] = age_of(team, me, seen, i, j, False) / settings.stale_after
