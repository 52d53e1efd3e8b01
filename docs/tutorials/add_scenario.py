"""Define a scenario, and compare policies on it with the bound.

python docs/tutorials/add_scenario.py
"""

import argparse

import posse
from posse_training import evaluate

parser = argparse.ArgumentParser()
parser.add_argument("--episodes", type=int, default=200)
arguments = parser.parse_args()

# A scenario is a value: start from a named one and change fields.
# Invalid values raise an error that states the valid range.
night = posse.get_scenario("obstacles").replace(
    name="night",
    version=1,
    sensing_range=3.0,
    radio_range=6.0,
    num_trackers=4,
)

# Every environment accepts it instead of a name.
env = posse.parallel_env(night)
observations, infos = env.reset(seed=1)
numbers = len(observations["tracker_0"])
print(f"{len(observations)} trackers, {numbers} numbers each")

# A useful benchmark leaves a gap between the best scripted team and the
# bound, and the planner, which reads the full state, should score
# clearly higher than the others.
play = {"episodes": arguments.episodes, "seed": 0, "progress": False}
for policy in ("pursuit", "ddcs-distributed", "planner"):
    results = evaluate(policy, night, split="validation", **play)
    share = results["score"].mean() / results["bound"].mean()
    score = results.estimate("score")
    print(f"{policy:18s} score {score}, {share:.2f} of the bound")
