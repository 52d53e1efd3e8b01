"""JaxMARL `MPE_simple_tag_v3`: 5 adversaries against 1 agent."""

from __future__ import annotations

from typing import Any

import jax
import jax_loop
import jaxmarl
from serve import Built, serve


def build(worlds: int, variant: str) -> Built:
    """Return a batch with automatic resets."""
    env = jaxmarl.make("MPE_simple_tag_v3", num_adversaries=5, num_good_agents=1, action_type="Continuous")

    def step(key: Any, state: Any, actions: Any) -> tuple[Any, Any, Any]:
        observations, state, rewards, _, _ = env.step(key, state, actions)
        return observations, state, rewards

    def draw(key: Any, count: int) -> Any:
        keys = jax.random.split(key, env.num_agents)
        return {agent: jax.random.uniform(k, (count, 5)) for agent, k in zip(env.agents, keys, strict=True)}

    observations, _ = env.reset(jax.random.key(0))
    longest = max(o.shape[0] for o in observations.values())
    return jax_loop.build(env, step, draw, worlds, env.num_agents, longest)


serve(build, "jaxmarl", "jax")
