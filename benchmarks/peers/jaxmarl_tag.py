"""JaxMARL `MPE_simple_tag_v3`: 5 adversaries against 1 agent; worlds by vmap, steps by scan, compiled as a whole."""

import os
import sys
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import jaxmarl
from serve import ACTION_SETS, Built, serve

# Cached, since compiling takes longer than measuring. The code depends on the number of threads.
_KEPT = Path(sys.prefix) / f"compiled-{len(os.sched_getaffinity(0))}"
jax.config.update("jax_compilation_cache_dir", str(_KEPT))


def build(worlds: int, variant: str) -> Built:
    """Return a batch with automatic resets."""
    env = jaxmarl.make("MPE_simple_tag_v3", num_adversaries=5, num_good_agents=1, action_type="Continuous")
    key, reset_key, action_key = jax.random.split(jax.random.key(0), 3)
    shape = (ACTION_SETS, worlds, 5)
    keys = jax.random.split(action_key, env.num_agents)
    actions = {agent: jax.random.uniform(k, shape) for agent, k in zip(env.agents, keys, strict=True)}
    observations, state = jax.jit(jax.vmap(env.reset))(jax.random.split(reset_key, worlds))
    chunk = max(1, min(256, 8192 // worlds))

    # The latest observations and the sum of the rewards are kept, so that the compiler cannot omit
    # them. A learner that keeps the observations of all steps needs more memory bandwidth.
    def one_step(carry: Any, k: Any) -> tuple[Any, None]:
        key, state, _, returns = carry
        key, step_key = jax.random.split(key)
        now = jax.tree.map(lambda a: a[k % ACTION_SETS], actions)
        observations, state, rewards, _, _ = jax.vmap(env.step)(jax.random.split(step_key, worlds), state, now)
        return (key, state, observations, jax.tree.map(jnp.add, returns, rewards)), None

    @jax.jit
    def many_steps(carry: Any) -> Any:
        return jax.lax.scan(one_step, carry, jnp.arange(chunk))[0]

    carry = (key, state, observations, {agent: jnp.zeros(worlds) for agent in env.agents})

    def run(steps: int) -> None:
        nonlocal carry
        for _ in range(steps // chunk):
            carry = many_steps(carry)
        jax.block_until_ready(carry)

    return Built(run, env.num_agents, max(o.shape[-1] for o in observations.values()), chunk)


serve(build, "jaxmarl", "jax")
