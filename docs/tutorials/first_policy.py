"""Train a first team, and evaluate it on the test split.

Takes about 3 minutes on a laptop: python docs/tutorials/first_policy.py
"""

import argparse
from dataclasses import replace
from pathlib import Path

from posse_baselines import load
from posse_training import evaluate
from posse_training.train import default_settings
from posse_training.train.train import train

parser = argparse.ArgumentParser()
parser.add_argument("--steps", type=int, default=8_000_000)
parser.add_argument(
    "--out", type=Path, default=Path("runs/tutorials/first")
)
parser.add_argument("--episodes", type=int, default=200)
arguments = parser.parse_args()

# `posse train --help` lists every setting.
settings = replace(
    default_settings("smart", "ppo"),
    steps=arguments.steps,
    seed=1,
    folder=arguments.out,
    num_worlds=128,
    evaluate_every=max(arguments.steps // 5, 1),
    tensorboard=False,
)
# The best policy on validation worlds, as one file; its card records
# how it was trained.
file = train(settings)
policy = load(file)

# The test split: used neither for training nor for selection.
for contender in (load("pursuit"), load("ddcs-distributed"), policy):
    results = evaluate(
        contender, "smart", episodes=arguments.episodes, progress=False
    )
    print(f"{contender.name:20s} {results.estimate('score')}")
