"""``posse/Tracker-v0``: one tracker is a Gymnasium agent, its team-mates are scripted."""

from functools import partial
from typing import Any

import gymnasium
import numpy as np
import pytest

import posse
from posse_baselines import PolicyError, batch_for, load, rollout
from posse_baselines.tracker_env import TrackerEnv, register


def test_a_learner_that_acts_as_the_policy_would_changes_nothing() -> None:
    register()  # once more
    policy = load("pursuit")
    env = TrackerEnv("smart", number=2, teammates=policy, seed=5, horizon=40)
    own, _ = env.reset()
    names = ("observations", "actions", "rewards", "score")
    played = rollout(batch_for(policy, "smart", seed=5, horizon=40), policy, names)
    for t in range(40):
        np.testing.assert_array_equal(own, played["observations"][t, 0, 2])
        own, reward, _, truncated, info = env.step(played["actions"][t, 0, 2])
        assert reward == pytest.approx(float(played["rewards"][t, 0, 2]))
        assert info["score"] == pytest.approx(float(played["score"][t, 0]))
    assert truncated
    assert info["metrics/score"] == pytest.approx(played.metrics["score"][0])


def test_a_planner_plays_the_team_mates_and_a_number_of_numpy_is_a_tracker() -> None:
    env: Any = gymnasium.make_vec("posse/Tracker-v0", 2, scenario="smart", teammates="planner", number=np.int64(1))
    env.reset(seed=4)
    for _ in range(3):
        env.step(np.ones((2, 2), np.float32))
    speeds = env.unwrapped.batch.arrays.tracker["speed"]
    assert (speeds[:, 1] == 1.0).all()
    assert speeds[:, 2:].max() > 0.5


@pytest.mark.parametrize("make", [TrackerEnv, partial(gymnasium.make_vec, "posse/Tracker-v0", 3)])
def test_what_cannot_be_played_is_refused(make: Any) -> None:
    for number in (5, 1.0, True):
        with pytest.raises(posse.ScenarioError, match=f"number={number} is not in the team"):
            make(scenario="constant", number=number)
    with pytest.raises(posse.ScenarioError, match="no team-mates"):
        make(scenario="constant", num_trackers=1)
    with pytest.raises(PolicyError, match="unknown policy 'pursiut'"):
        make(scenario="constant", teammates="pursiut")
    with pytest.raises(TypeError, match="target_policy= is not possible"):
        make(scenario="constant", target_policy=load("idle"))
