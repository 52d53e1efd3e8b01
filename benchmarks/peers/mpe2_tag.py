"""mpe2 `simple_tag_v3`: 5 adversaries, 1 agent, through PettingZoo's parallel interface."""

import numpy as np
from mpe2 import simple_tag_v3
from serve import ACTION_SETS, Built, serve


def build(worlds: int, variant: str) -> Built:
    """Return one world with episodes as long as posse's."""
    env = simple_tag_v3.parallel_env(
        num_good=1, num_adversaries=5, num_obstacles=2, max_cycles=600, continuous_actions=True
    )
    env.reset(seed=0)
    agents = env.possible_agents
    rng = np.random.default_rng(0)
    actions = [{agent: rng.uniform(0, 1, 5).astype(np.float32) for agent in agents} for _ in range(ACTION_SETS)]

    def run(steps: int) -> None:
        for k in range(steps):
            env.step(actions[k % ACTION_SETS])
            if not env.agents:
                env.reset()

    return Built(run, len(agents), max(env.observation_space(a).shape[0] for a in agents))


serve(build, "mpe2", "pettingzoo", "numpy")
