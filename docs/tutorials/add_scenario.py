"""A scenario of your own, and what it leaves open between the best team and what is possible.

python docs/tutorials/add_scenario.py
"""

import argparse

import posse
from posse_training import evaluate

parser = argparse.ArgumentParser()
parser.add_argument("--episodes", type=int, default=200)
arguments = parser.parse_args()

# A scenario is a value: start from one that has a name, and change fields. Impossible ones are
# refused with a message that says what is possible.
night = posse.get_scenario("obstacles").replace(
    name="night",
    version=1,
    sensing_range=3.0,
    radio_range=6.0,
    num_trackers=4,
)

# Every environment takes it in the place of a name.
env = posse.parallel_env(night)
observations, infos = env.reset(seed=1)
print(f"{len(observations)} trackers, {len(observations['tracker_0'])} numbers each")

# Is it worth playing? There should be room between the best scripted team and the bound, and the
# planner, which reads the state, should do clearly better than those who do not.
for policy in ("pursuit", "ddcs-distributed", "planner"):
    results = evaluate(
        policy, night, arguments.episodes, seed=0, split="validation", progress=False
    )
    share = results["score"].mean() / results["bound"].mean()
    print(f"{policy:18s} score {results.estimate('score')}, {share:.2f} of the bound")
