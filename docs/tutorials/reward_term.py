"""Use a new reward term: weighted in a scenario, and reported by name.

Needs the term `steady` in envs/posse/signals/reward.py: python docs/tutorials/reward_term.py
"""

import argparse

import numpy as np

import posse

parser = argparse.ArgumentParser()
parser.add_argument("--steps", type=int, default=100)
arguments = parser.parse_args()

weights = {"slot": 1.0, "steady": 0.1}
env = posse.parallel_env("constant", reward_weights=weights)
env.reset(seed=1)
for _ in range(arguments.steps):
    # The first tracker drives straight, the others in circles.
    rewards, infos = env.step(
        {
            agent: np.array([1.0, 0.0 if agent == "tracker_0" else 1.0], np.float32)
            for agent in env.agents
        }
    )[1::3]

# Terms are reported unscaled, by name; the reward is their weighted sum.
for agent, info in infos.items():
    terms = info["reward_terms"]
    expected = sum(weight * terms[name] for name, weight in weights.items())
    print(f"{agent}: steady {terms['steady']:.0f}, reward {rewards[agent]:.2f} = {expected:.2f}")
