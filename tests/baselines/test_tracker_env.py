from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from tests.support.adapters import out_of_band, same

import posse
import posse_baselines
from posse_baselines import PolicyError, begin, load
from posse_baselines.tracker_env import TrackerEnv

SHORT: dict[str, Any] = {"horizon": 40}


@pytest.mark.parametrize("scenario", ["constant", "obstacles", "field"])
@pytest.mark.parametrize("discrete", [False, True])
def test_it_passes_gymnasiums_check(scenario: str, discrete: bool) -> None:
    env = gymnasium.make("posse/Tracker-v0", scenario=scenario, discrete_actions=discrete, teammates="pursuit", **SHORT)
    check_env(env.unwrapped, skip_render_check=True)


def test_a_learner_that_acts_as_the_policy_would_changes_nothing() -> None:
    policy = load("ddcs-distributed")
    size = policy.message_size
    env = TrackerEnv("smart", number=2, silent=False, seed=5, **SHORT)
    own, _ = env.reset()
    batch = posse.batch("smart", 1, seed=5, message_size=size, **SHORT)
    memory, observations = begin(policy, batch), batch.reset()
    for _ in range(40):
        np.testing.assert_array_equal(own, observations[0, 2])
        actions, memory = policy.act(observations, memory)
        own, reward, _, truncated, info = env.step(actions[0, 2])
        observations, rewards, _, _, infos = batch.step(actions)
        assert reward == pytest.approx(float(rewards[0, 2]))
        assert info["score"] == pytest.approx(float(infos["score"][0]))
    assert truncated
    assert info["metrics/score"] == pytest.approx(float(infos["metrics/score"][0]))


def test_one_that_was_pickled_out_of_band_goes_on_alike() -> None:
    env = TrackerEnv("smart", seed=5, **SHORT)
    env.reset()
    twin = out_of_band(env)
    for _ in range(5):
        action = env.action_space.sample()
        assert same(env.step(action), twin.step(action))
    assert same(env.reset(seed=1), twin.reset(seed=1))


def test_the_learners_action_moves_its_tracker_and_no_other() -> None:
    env = TrackerEnv("constant", number=1, teammates="idle", seed=3, **SHORT)
    env.reset()
    before = env.layout.views(env.batch.observe())["position"].copy()
    for _ in range(10):
        env.step(np.array([1.0, 0.0], np.float32))
    moved = np.linalg.norm(env.layout.views(env.batch.observe())["position"] - before, axis=-1)[0]
    assert moved[1] == pytest.approx(1.0, abs=1e-4)
    assert (np.delete(moved, 1) == 0).all()


def test_a_silent_learner_says_zeros() -> None:
    env = TrackerEnv("constant", number=0, teammates="ddcs-distributed", seed=3, **SHORT)
    assert env.action_space.shape == (2,)
    env.reset()
    for _ in range(5):
        env.step(np.zeros(2, np.float32))
    views = env.layout.views(env.batch.observe()[0, 1])
    heard = views["neighbour_message"][views["neighbour_number"] == 0]
    np.testing.assert_array_equal(heard, 0)


def test_what_does_not_fit_is_named() -> None:
    with pytest.raises(ValueError, match="number=5 is not in the team"):
        TrackerEnv("constant", number=5)
    with pytest.raises(posse.ScenarioError, match="no team-mates"):
        TrackerEnv("constant", num_trackers=1)
    with pytest.raises(posse.ScenarioError, match="not possible in posse/Tracker-v0"):
        TrackerEnv("constant", target_motion="agent")
    with pytest.raises(PolicyError, match="unknown policy 'pursiut'"):
        TrackerEnv("constant", teammates="pursiut")
    env = TrackerEnv("constant", teammates="idle")
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros(2, np.float32))
    env.reset(seed=1)
    with pytest.raises(ValueError, match="tracker_0: speed = nan"):
        env.step(np.array([np.nan, 0], np.float32))


def test_the_package_registers_it() -> None:
    assert posse_baselines.__doc__
    assert "posse/Tracker-v0" in gymnasium.registry
