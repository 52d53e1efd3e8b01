"""A new reward term at work: weighed by a scenario, and reported by its name."""

import argparse

import numpy as np

import posse


@posse.reward_term("1")
def steady(c, w, t):
    """1 while the tracker turns at less than a tenth of its greatest turn rate, else 0."""
    return abs(t.turn_rate) < 0.1 * t.max_turn_rate


parser = argparse.ArgumentParser()
parser.add_argument("--steps", type=int, default=100)
arguments = parser.parse_args()

weights = {"slot": 1.0, "steady": 0.1}
env = posse.parallel_env("constant", reward_weights=weights)
env.reset(seed=1)
for _ in range(arguments.steps):
    # The first tracker drives straight, the others in circles.
    rewards, infos = env.step(
        {agent: np.array([1.0, 0.0 if agent == "tracker_0" else 1.0], np.float32) for agent in env.agents}
    )[1::3]

# Terms are reported unscaled, by name; the reward is their weighted sum.
for agent, info in infos.items():
    expected = sum(weight * info[f"reward/{name}"] for name, weight in weights.items())
    print(f"{agent}: steady {info['reward/steady']:.0f}, reward {rewards[agent]:.2f} = {expected:.2f}")
