"""posse through PettingZoo: one `smart` world of 5 trackers, with dictionaries by agent."""

import numpy as np
from serve import ACTION_SETS, Built, serve

import posse


def build(worlds: int, variant: str) -> Built:
    """Return one world, which is reset at the end of an episode."""
    env = posse.parallel_env("smart")
    env.reset(seed=0)
    agents = env.possible_agents
    rng = np.random.default_rng(0)
    actions = [{agent: rng.uniform(-1, 1, 2).astype(np.float32) for agent in agents} for _ in range(ACTION_SETS)]

    def run(steps: int) -> None:
        for k in range(steps):
            env.step(actions[k % ACTION_SETS])
            if not env.agents:
                env.reset()

    return Built(run, len(agents), env.observation_space(agents[0]).shape[0])


serve(build, "numpy", "numba", "pettingzoo")
