"""Pursuit: each tracker goes straight at the target, and avoids what its sonar finds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from posse import ObservationLayout
from posse.numeric import FloatArray, OwnArrays, Record, Records, compiled, kernel, over_worlds
from posse_baselines.laws.offsets import constants_of, offsets_of
from posse_baselines.policy import BasePolicy, Memory, check_fits, check_observations

_KEEP_AWAY: Final = 0.5  # free width that a tracker keeps to anything, m
_STOP: Final = 0.9  # distance from the target at which it stops, m


@dataclass(frozen=True)
class _PursuitMemory(OwnArrays):
    layout: ObservationLayout
    num_worlds: int
    offsets: Records
    constants: Records


class Pursuit(BasePolicy):
    """Velocity pursuit without a formation: the naive team."""

    name = "pursuit"

    def begin(self, layout: ObservationLayout, num_worlds: int) -> Memory:
        """Return the memory: the layout, the number of worlds, where the fields are."""
        check_fits(self, layout)
        return _PursuitMemory(layout, num_worlds, offsets_of(layout), constants_of(layout.scenario))

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return actions straight at the last fix of the target; in a circle without one."""
        m: _PursuitMemory = memory
        observations = check_observations(self, observations, m.num_worlds, m.layout)
        num_worlds, num_trackers = observations.shape[:2]
        actions = np.zeros((num_worlds, num_trackers, 2 + m.layout.scenario.message_size), np.float32)
        over_worlds(pursue_all, (m.offsets, m.constants, observations, actions), num_worlds, num_trackers)
        return actions, memory


@compiled
def pursue(at: Record, dt: float, row: FloatArray, action: FloatArray) -> None:
    """Write one tracker's action (2 + m,) for what it is given, (F,)."""
    speed, turn = 1.0, 0.2
    if row[at.target_known] > 0.0:
        age = max(0.0, row[at.target_age])
        x = row[at.target_range] * row[at.target_bearing] + age * row[at.target_velocity]
        y = row[at.target_range] * row[at.target_bearing + 1] + age * row[at.target_velocity + 1]
        bearing = math.atan2(y, x)
        turn = bearing / (2.0 * dt * row[at.max_turn_rate])
        speed = max(0.0, math.cos(bearing)) if math.hypot(x, y) > _STOP else 0.0
    # The nearest thing within the keep-away width turns it aside, and slows it if it is ahead.
    for k in range(at.sonar_beams):
        gap = row[at.sonar + k]
        if gap < _KEEP_AWAY:
            angle = 2.0 * math.pi * k / at.sonar_beams
            angle = angle - 2.0 * math.pi if angle > math.pi else angle
            closeness = 1.0 - gap / _KEEP_AWAY
            if math.cos(angle) > 0.3:
                speed = min(speed, 0.8 * (1.0 - closeness))
                turn = turn - (1.0 if angle >= 0.0 else -1.0) * (0.5 + closeness)
    action[0] = 2.0 * min(max(speed, 0.0), 1.0) - 1.0
    action[1] = min(max(turn, -1.0), 1.0)


@kernel
def pursue_all(
    offsets: Records,
    constants: Records,
    observations: FloatArray,
    actions: FloatArray,
    thread: int,
    first: int,
    end: int,
) -> None:
    """Write the actions of a share of the worlds."""
    at, dt = offsets[0], constants[0].dt
    for e in range(first, end):
        for i in range(observations.shape[1]):
            pursue(at, dt, observations[e, i], actions[e, i])
