"""Stepping of JAX simulators: worlds by vmap, steps by scan, compiled as a whole."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
from serve import ACTION_SETS, Built

# Cached, since compiling takes longer than measuring. The code depends on the number of threads.
_KEPT = Path(sys.prefix) / f"compiled-{len(os.sched_getaffinity(0))}"
jax.config.update("jax_compilation_cache_dir", str(_KEPT))

Tree = Any
"""Arrays in any structure."""


def build(
    env: Any,
    step: Callable[[Any, Any, Any], tuple[Tree, Tree, Tree]],
    draw_actions: Callable[[Any, int], Tree],
    worlds: int,
    agents: int,
    observation: int,
) -> Built:
    """Return a batch of worlds.

    Args:
        env: Environment with ``reset(key)`` -> observations, state.
        step: Step of one world: (key, state, actions) -> observations, state, rewards.
        draw_actions: (key, B) -> actions of B worlds.
        worlds: B, number of worlds.
        agents: Number of agents in a world.
        observation: Length of an agent's observation.
    """
    key = jax.random.key(0)
    key, reset_key, action_key = jax.random.split(key, 3)
    actions = jax.jit(lambda k: jax.vmap(lambda one: draw_actions(one, worlds))(jax.random.split(k, ACTION_SETS)))(
        action_key
    )
    observations, state = jax.jit(jax.vmap(env.reset))(jax.random.split(reset_key, worlds))
    chunk = max(1, min(256, 8192 // worlds))

    # The latest observations and the sum of the rewards are kept, so that the compiler cannot omit
    # them. A learner that keeps the observations of all steps needs more memory bandwidth.
    def one_step(carry: Tree, k: Any) -> tuple[Tree, None]:
        key, state, _, returns = carry
        key, step_key = jax.random.split(key)
        now = jax.tree.map(lambda a: a[k % ACTION_SETS], actions)
        observations, state, rewards = jax.vmap(step)(jax.random.split(step_key, worlds), state, now)
        returns = jax.tree.map(jnp.add, returns, rewards)
        return (key, state, observations, returns), None

    @jax.jit
    def many_steps(carry: Tree) -> Tree:
        return jax.lax.scan(one_step, carry, jnp.arange(chunk))[0]

    shapes = jax.eval_shape(
        jax.vmap(step), jax.random.split(key, worlds), state, jax.tree.map(lambda a: a[0], actions)
    )[2]
    returns = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shapes)
    carry = (key, state, observations, returns)

    def run(steps: int) -> None:
        nonlocal carry
        for _ in range(steps // chunk):
            carry = many_steps(carry)
        jax.block_until_ready(carry)

    return Built(run, agents, observation, chunk)
