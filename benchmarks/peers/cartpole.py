"""Gymnasium's vector CartPole: numpy over the whole batch, one agent per world."""

from __future__ import annotations

import gymnasium
import numpy as np
from serve import ACTION_SETS, Built, serve


def build(worlds: int, variant: str) -> Built:
    """Return a batch with automatic resets."""
    envs = gymnasium.make_vec("CartPole-v1", num_envs=worlds, vectorization_mode="vector_entry_point")
    envs.reset(seed=0)
    actions = np.random.default_rng(0).integers(0, 2, (ACTION_SETS, worlds))

    def run(steps: int) -> None:
        for k in range(steps):
            envs.step(actions[k % ACTION_SETS])

    return Built(run, 1, envs.single_observation_space.shape[0])


serve(build, "gymnasium", "numpy")
