"""What a tracker of the DDCS believes, as numbers that a network can read.

All vectors are relative to the tracker: x ahead, y to the left. A length d is scaled to
d / (d + scale), which resolves both centimetres and tens of metres.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from posse.numeric import FloatArray, Record, Records, compiled, record_type
from posse_baselines.ddcs.memory import GRID, Minds, Team, for_each, since
from posse_baselines.ddcs.monitoring import is_there, mate_now, others_there
from posse_baselines.ddcs.motion import age_of
from posse_baselines.ddcs.settings import SEARCHING, TASKS
from posse_baselines.laws.geometry import length, scaled, vector
from posse_baselines.laws.steering import Work, slot_velocity

_F, _C = np.float32, np.complex64
_MATES: Final = 3
_LOOKS: Final = 8

BELIEF: Final = record_type(
    # 0 while there is no estimate of the target
    ("known", _F),  # 0 or 1
    ("target", _C),  # position / (d + 3 m)
    ("target_velocity", _C),  # m/s
    ("frame", _C),  # heading of the slot frame
    ("frame_rate", _F),  # rad/s
    ("age", _F),  # of the estimate, / (age + 1 s)
    ("task", _F, (len(TASKS),)),  # 1 for the present one
    ("has_slot", _F),  # 0 or 1
    ("slot_near", _C),  # the way to the slot / (d + 0.3 m)
    ("slot_far", _C),  # and / (d + 3 m)
    ("slot_velocity", _C),  # m/s
    ("lost", _F),  # while searching: time since the target was lost / (t + 10 s)
    ("goal", _C),  # and the way to the goal / (d + 3 m)
    ("present", _F),  # share of the team-mates that count as present
    ("mates", _C, (_MATES,)),  # positions of those nearest by its estimate of where they are now, / (d + 1 m)
    # time since the team last looked at the place one sensing range away, from ahead to the left; 1: long ago
    ("looks", _F, (_LOOKS,)),
)
"""A belief."""
BELIEF_SIZE: Final = BELIEF.itemsize // 4
"""Numbers in a belief."""

_NEAR: Final = 0.3  # m
_FAR: Final = 3.0  # m
_BESIDE: Final = 1.0  # m
_LOST: Final = 10.0  # s


@compiled
def soft(me: Record, v: complex, scale: float) -> complex:
    """Return a vector (m) as it lies to the tracker, its length scaled."""
    return scaled(v * me.heading.conjugate(), 1.0 / (length(v) + scale))


@compiled
def believe(team: Team, me: Record, mates: Records, row: FloatArray, work: Work, belief: Record) -> None:
    """Write the :data:`BELIEF` of one tracker; it is 0 before."""
    back = me.heading.conjugate()
    if me.known != 0:
        belief.known = 1.0
        belief.target = soft(me, me.target - me.position, _FAR)
        belief.target_velocity, belief.frame = me.target_velocity * back, me.frame * back
        belief.frame_rate, belief.age = me.psi_rate, me.fix_age / (me.fix_age + 1.0)
    belief.task[me.task] = 1.0
    if me.slot >= 0:
        arm = team.slots[me.slot] * me.frame
        way = me.target + arm - me.position
        belief.has_slot, belief.slot_near, belief.slot_far = 1.0, soft(me, way, _NEAR), soft(me, way, _FAR)
        belief.slot_velocity = slot_velocity(me.target_velocity, me.psi_rate, arm) * back
    if me.task == SEARCHING:
        lost = since(team, me, max(0, me.lost_step))
        belief.lost = lost / (lost + _LOST)
        if me.goal_step >= 0:
            belief.goal = soft(me, me.goal - me.position, _FAR)
    write_mates(team, me, mates, belief)
    if team.world.searches:
        write_looks(team, me, belief)


@compiled
def write_mates(team: Team, me: Record, mates: Records, belief: Record) -> None:
    """Write the share of team-mates that are there, and the nearest ones in order."""
    there, last, last_j = others_there(team, me, mates), -1.0, -1
    belief.present = there / max(1.0, len(mates) - 1.0)
    for k in range(min(there, _MATES)):
        least, best, nearest = 1e9, -1, 0j
        for j in range(len(mates)):
            if is_there(team, me, mates[j]):
                way = mate_now(team, me, mates[j])[0] - me.position
                away = length(way)
                if (away > last or (away == last and j > last_j)) and away < least:
                    least, best, nearest = away, j, way
        if best < 0:
            break
        belief.mates[k] = soft(me, nearest, _BESIDE)
        last, last_j = least, best


@compiled
def write_looks(team: Team, me: Record, belief: Record) -> None:
    """Write how long ago the team covered the places around; 0 beyond the area."""
    world = team.world
    scale_x, scale_y = GRID / (2.0 * world.area_x), GRID / (2.0 * world.area_y)
    for k in range(_LOOKS):
        there = me.position + scaled(vector(1.0, 2.0 * math.pi * k / _LOOKS) * me.heading, world.sight) - me.area
        i = math.floor((there.real + world.area_x) * scale_x)
        j = math.floor((there.imag + world.area_y) * scale_y)
        if 0 <= i < GRID and 0 <= j < GRID:
            belief.looks[k] = age_of(team, me, i, j, False) / team.settings.stale_after


_believe_all = for_each(believe)


def beliefs_of(minds: Minds, observations: FloatArray) -> FloatArray:
    """Return what each tracker believes after it planned by observations (E, N, F): (E, N, BELIEF_SIZE)."""
    beliefs = np.zeros(minds.me.shape, BELIEF)
    minds.run(_believe_all, observations, beliefs)
    return beliefs.view(np.float32).reshape(*beliefs.shape, BELIEF_SIZE)
