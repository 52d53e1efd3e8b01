"""CAMAR: 5 differential-drive robots drive to their goals on a small map with 3 obstacles."""

from __future__ import annotations

from typing import Any

import jax
import jax_loop
from camar import camar_v0
from serve import Built, serve


def build(worlds: int, variant: str) -> Built:
    """Return a batch with two physics steps per step, as in posse; episodes never end."""
    env = camar_v0(
        "random_grid",
        dynamic="DiffDriveDynamic",
        frameskip=1,
        map_kwargs={"num_rows": 8, "num_cols": 8, "obstacle_density": 0.05, "num_agents": 5},
    )

    def step(key: Any, state: Any, actions: Any) -> tuple[Any, Any, Any]:
        observations, state, rewards, _, _ = env.step(key, state, actions)
        return observations, state, rewards

    def draw(key: Any, count: int) -> Any:
        shape = (count, env.num_agents, env.action_size)
        return jax.random.uniform(key, shape, minval=-1.0, maxval=1.0)

    return jax_loop.build(env, step, draw, worlds, env.num_agents, env.observation_size)


serve(build, "camar", "jax")
