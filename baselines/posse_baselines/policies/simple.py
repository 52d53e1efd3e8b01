"""Lower bounds for comparisons: policies that stand still or act at random."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from posse.numeric import ONE, FloatArray, kernel
from posse.rules import mix
from posse_baselines.policy import BasePolicy, Memory

_SHIFT: Final = np.uint64(40)
_TO_BOTH_SIDES: Final = np.float32(2.0**-23)


class Idle(BasePolicy):
    """Every tracker stays where it is."""

    name = "idle"

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return V = 0 and ω = 0 for everyone."""
        actions = np.zeros((*observations.shape[:2], 2 + memory.scenario.message_size), np.float32)
        actions[:, :, 0] = -1.0
        return actions, memory


class Random(BasePolicy):
    """Every number of every action is drawn uniformly from [-1, 1).

    A draw is a function of the seed and of what the tracker is given, so that a world plays alike
    alone and in any batch.

    Args:
        seed: Of the draws, at least 0.
    """

    name = "random"

    def __init__(self, seed: int = 0) -> None:
        if not 0 <= seed < 2**63:
            raise ValueError(f"seed={seed!r} must be a whole number in [0, 2**63)")
        self.seed = seed

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return random speeds, turn rates and messages."""
        words = np.ascontiguousarray(observations, np.float32).view(np.uint32)
        actions = np.empty((*words.shape[:2], 2 + memory.scenario.message_size), np.float32)
        draw_from_observations(words, np.uint64(self.seed), actions)
        return actions, memory


@kernel
def draw_from_observations(words: npt.NDArray[np.uint32], seed: np.uint64, actions: FloatArray) -> None:
    """Fill actions (E, N, A) with draws keyed by the seed and observations (E, N, F) as words."""
    for e in range(words.shape[0]):
        for i in range(words.shape[1]):
            key = mix(seed, np.uint64(i))
            for k in range(words.shape[2]):
                key = mix(key, np.uint64(words[e, i, k]))
            for k in range(actions.shape[2]):
                draw = mix(key, np.uint64(k)) >> _SHIFT
                actions[e, i, k] = np.float32(draw) * _TO_BOTH_SIDES - ONE
