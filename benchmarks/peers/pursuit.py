"""PettingZoo SISL `pursuit`: 5 pursuers on a grid, each observing a 7 x 7 window of 3 layers."""

from __future__ import annotations

import warnings

import numpy as np
from pettingzoo.sisl import pursuit_v5
from serve import ACTION_SETS, Built, serve


def build(worlds: int, variant: str) -> Built:
    """Return one world of 5 pursuers and 1 evader with episodes as long as posse's."""
    env = pursuit_v5.parallel_env(n_pursuers=5, n_evaders=1, max_cycles=600)
    env.reset(seed=0)
    agents = env.possible_agents
    rng = np.random.default_rng(0)
    actions = [{agent: int(rng.integers(env.action_space(agent).n)) for agent in agents} for _ in range(ACTION_SETS)]

    def run(steps: int) -> None:
        for k in range(steps):
            env.step(actions[k % ACTION_SETS])
            if not env.agents:
                env.reset()

    return Built(run, len(agents), int(np.prod(env.observation_space(agents[0]).shape)))


warnings.simplefilter("ignore")
serve(build, "pettingzoo", "numpy")
