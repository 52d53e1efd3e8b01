"""Train one learner among scripted team-mates, with unmodified stable-baselines3.

python docs/tutorials/one_tracker.py
"""

import argparse
from pathlib import Path

import gymnasium as gym
import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.monitor import Monitor

import posse_baselines  # registers posse/Tracker-v0

parser = argparse.ArgumentParser()
parser.add_argument("--steps", type=int, default=200_000)
parser.add_argument("--rollout", type=int, default=2048)
parser.add_argument("--episodes", type=int, default=20)
parser.add_argument("--file", type=Path, default=Path("runs/tutorials/one_tracker.zip"))
arguments = parser.parse_args()
assert "ddcs-distributed" in posse_baselines.policy_names()

TEAM = {"scenario": "constant", "teammates": "ddcs-distributed", "number": 2}

# Scripted team-mates exchange messages; the learner receives them but sends none: two actions.
env = Monitor(gym.make("posse/Tracker-v0", **TEAM))
model = PPO("MlpPolicy", env, n_steps=arguments.rollout, gamma=0.98, seed=1, device="cpu")
model.learn(arguments.steps)
arguments.file.parent.mkdir(parents=True, exist_ok=True)
model.save(arguments.file)

# Evaluation on the test split. The score is the team's: one tracker contributes a fifth.
test = gym.make("posse/Tracker-v0", **TEAM, split="test", seed=7)
learned = PPO.load(arguments.file, device="cpu")
scores = []
for _ in range(arguments.episodes):
    observation, _ = test.reset()
    over = False
    while not over:
        action, _ = learned.predict(observation, deterministic=True)
        observation, _, terminated, truncated, info = test.step(action)
        over = terminated or truncated
    scores.append(info["metrics/score"])
print(f"score of the team {np.mean(scores):.3f} in {len(scores)} worlds")
