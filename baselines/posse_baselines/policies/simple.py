"""Lower bounds for comparisons: policies that stand still, act at random, or go straight at the target."""

import functools
from typing import Final

import numpy as np
import numpy.typing as npt

from posse import ObservationLayout
from posse.numeric import FloatArray
from posse_baselines.policy import BasePolicy, Memory, check_observations

_SHIFT: Final = np.uint64(40)
_TO_BOTH_SIDES: Final = np.float32(2.0**-23)
_KEEP_AWAY: Final = 0.5  # free width that a tracker keeps to anything, m
_STOP: Final = 0.9  # distance from the target at which it stops, m


class Idle(BasePolicy):
    """Every tracker stays where it is."""

    name = "idle"

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return V = 0 and ω = 0 for everyone."""
        actions = np.zeros((*observations.shape[:2], 2 + memory.scenario.message_size), np.float32)
        actions[:, :, 0] = -1.0
        return actions, memory


@functools.cache
def _factors(*shape: int) -> npt.NDArray[np.uint64]:
    """Return the factors (N, 2 + m, F) that make draws of observations."""
    return np.random.default_rng(0).integers(2**64, size=shape, dtype=np.uint64)


class Random(BasePolicy):
    """Every number of every action is drawn uniformly from [-1, 1).

    A draw is a function of what the tracker is given, so that a world plays alike alone and in any batch.
    """

    name = "random"

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return random speeds, turn rates and messages."""
        s = memory.scenario
        words = np.ascontiguousarray(observations, np.float32).view(np.uint32).astype(np.uint64)
        factors = _factors(s.num_trackers, 2 + s.message_size, memory.size)
        draws = np.einsum("eif,iaf->eia", words, factors) >> _SHIFT  # the highest bits of products depend on all others
        return draws.astype(np.float32) * _TO_BOTH_SIDES - np.float32(1.0), memory


class Pursuit(BasePolicy):
    """Velocity pursuit without a formation: the naive team."""

    name = "pursuit"

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return actions straight at the last fix of the target; in a circle without one."""
        layout: ObservationLayout = memory
        s = layout.scenario
        v = layout.views(check_observations(observations, (len(observations), s.num_trackers), layout))
        fix = np.abs(v["target_range"])[..., None] * v["target_bearing"]  # -1: of a bearing alone
        x, y = np.moveaxis(fix + np.maximum(v["target_age"], 0.0)[..., None] * v["target_velocity"], -1, 0)
        known, bearing = v["target_known"] > 0, np.arctan2(y, x)
        turn = np.where(known, bearing / (2.0 * s.control_step * v["max_turn_rate"]), 0.2)
        speed = np.where(known, np.where(np.hypot(x, y) > _STOP, np.maximum(np.cos(bearing), 0.0), 0.0), 1.0)
        # What is ahead within the keep-away width turns it aside, and slows it.
        angles = 2.0 * np.pi * np.arange(s.sonar_beams) / max(1, s.sonar_beams)
        if (ahead := np.cos(angles) > 0.3).any():
            closeness = 1.0 - v["sonar"].reshape(*turn.shape, -1)[..., ahead] / _KEEP_AWAY
            near, left = closeness > 0.0, np.where(angles[ahead] <= np.pi, 1.0, -1.0)
            speed = np.minimum(speed, np.where(near, 0.8 * (1.0 - closeness), 1.0).min(axis=-1))
            turn = turn - np.where(near, left * (0.5 + closeness), 0.0).sum(axis=-1)
        actions = np.zeros((*turn.shape, 2 + s.message_size), np.float32)
        actions[..., 0], actions[..., 1] = 2.0 * speed - 1.0, np.clip(turn, -1.0, 1.0)
        return actions, memory
