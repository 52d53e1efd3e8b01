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
from posse_baselines.ddcs.memory import GRID, SEARCHING
from posse_baselines.ddcs.monitoring import is_there, mate_now
from posse_baselines.ddcs.tracking.searching import age_of
from posse_baselines.ddcs.tracking.slots import slot_place
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
def soft(x: float, y: float, heading_c: float, heading_s: float, scale: float, out: FloatArray) -> None:
    """Write a vector of the common frame (m) relative to the tracker, its length scaled."""
    by = 1.0 / (length(x, y) + scale)
    out[0] = by * (x * heading_c + y * heading_s)
    out[1] = by * (y * heading_c - x * heading_s)


@compiled
def write_belief(
    f: Record,
    s: Record,
    slots: Records,
    d: Record,
    mates: Records,
    seen: npt.NDArray[np.uint16],
    o: FloatArray,
    out: FloatArray,
) -> None:
    """Write the belief (BELIEF_SIZE,) of one tracker after it planned for its observation (F,)."""
    for k in range(BELIEF_SIZE):
        out[k] = _ZERO
    x, y = float(o[f.position]), float(o[f.position + 1])
    hc, hs = float(o[f.heading]), float(o[f.heading + 1])
    if d.known != 0:
        b = out[TARGET_AT:]
        b[0] = 1.0
        soft(d.now_x - x, d.now_y - y, hc, hs, _FAR, b[1:3])
        b[3] = d.speed_x * hc + d.speed_y * hs
        b[4] = d.speed_y * hc - d.speed_x * hs
        b[5] = d.frame_cos * hc + d.frame_sin * hs
        b[6] = d.frame_sin * hc - d.frame_cos * hs
        b[7] = d.psi_rate
        b[8] = d.age / (d.age + 1.0)
    out[TASK_AT + d.task] = 1.0
    if d.slot >= 0:
        b = out[SLOT_AT:]
        place_x, place_y, arm_x, arm_y = slot_place(d, slots[d.slot])
        vx, vy = d.speed_x - d.psi_rate * arm_y, d.speed_y + d.psi_rate * arm_x
        b[0] = 1.0
        soft(place_x - x, place_y - y, hc, hs, _NEAR, b[1:3])
        soft(place_x - x, place_y - y, hc, hs, _FAR, b[3:5])
        b[5] = vx * hc + vy * hs
        b[6] = vy * hc - vx * hs
    if d.task == SEARCHING:
        b = out[SEARCH_AT:]
        lost = float(d.step - max(0, d.lost_step)) * f.dt
        b[0] = lost / (lost + _LOST)
        if d.goal_step >= 0:
            soft(d.goal_x - x, d.goal_y - y, hc, hs, _FAR, b[1:3])
    _write_mates(f, s, d, mates, int(o[f.number]), x, y, hc, hs, out[MATES_AT:])
    if len(seen) > 0:
        _write_looks(f, s, d, seen, x, y, hc, hs, out[LOOKS_AT:])


@compiled
def _write_mates(
    f: Record,
    s: Record,
    d: Record,
    mates: Records,
    own: int,
    x: float,
    y: float,
    heading_c: float,
    heading_s: float,
    out: FloatArray,
) -> None:
    """Write the share of team-mates that are there, and the nearest ones in order."""
    there, last, last_j = 0, -1.0, -1
    for j in range(len(mates)):
        if j != own and is_there(f, s, d, mates[j], len(mates)):
            there += 1
    out[0] = there / max(1.0, len(mates) - 1.0)
    for k in range(min(there, MATES)):
        least, best = 1e9, -1
        for j in range(len(mates)):
            if j == own or not is_there(f, s, d, mates[j], len(mates)):
                continue
            at_x, at_y = mate_now(f, s, d, mates[j])
            way = length(at_x - x, at_y - y)
            after = way > last or (way == last and j > last_j)
            if after and way < least:
                least, best = way, j
        if best < 0:
            break
        at_x, at_y = mate_now(f, s, d, mates[best])
        soft(at_x - x, at_y - y, heading_c, heading_s, _BESIDE, out[1 + 2 * k : 3 + 2 * k])
        last, last_j = least, best


@compiled
def _write_looks(
    f: Record,
    s: Record,
    d: Record,
    seen: npt.NDArray[np.uint16],
    x: float,
    y: float,
    heading_c: float,
    heading_s: float,
    out: FloatArray,
) -> None:
    """Write how long ago the team covered the places around; 0 beyond the area."""
    scale = GRID / (2.0 * f.area)
    for k in range(LOOKS):
        angle = 2.0 * math.pi * k / LOOKS
        c, n = math.cos(angle), math.sin(angle)
        i = math.floor((x + f.sight * (c * heading_c - n * heading_s) - d.area_x + f.area) * scale)
        j = math.floor((y + f.sight * (c * heading_s + n * heading_c) - d.area_y + f.area) * scale)
        if 0 <= i < GRID and 0 <= j < GRID:
            out[k] = age_of(f, s, d, seen, i, j, False) / s.stale_after
