"""VMAS `simple_tag`: 5 adversaries against 1 agent, torch over the whole batch."""

import os

import torch
import vmas
from serve import ACTION_SETS, Built, serve


def build(worlds: int, variant: str) -> Built:
    """Return a batch with VMAS's 10 physics substeps, or with 1; episodes never end."""
    torch.set_num_threads(len(os.sched_getaffinity(0)))
    env = vmas.make_env("simple_tag", num_envs=worlds, num_adversaries=5, seed=0)
    if variant == "1 substep":
        # Set when the scenario makes its world, and not open to settings.
        env.world._substeps = 1
        env.world._sub_dt = env.world._dt
    env.reset()
    draws = torch.Generator().manual_seed(0)
    actions = [
        [torch.rand(worlds, space.shape[0], generator=draws) * 2 - 1 for space in env.action_space]
        for _ in range(ACTION_SETS)
    ]

    def run(steps: int) -> None:
        for k in range(steps):
            env.step(actions[k % ACTION_SETS])

    return Built(run, env.n_agents, max(s.shape[0] for s in env.observation_space))


serve(build, "vmas", "torch", "numpy")
