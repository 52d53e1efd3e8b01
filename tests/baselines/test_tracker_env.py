"""``posse/Tracker-v0``: one tracker is a Gymnasium agent, its team-mates are scripted; alone and in many worlds."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from tests.support.adapters import out_of_band, same

import posse
from posse_baselines import PolicyError, begin, load
from posse_baselines.playing import poses_of
from posse_baselines.tracker_env import TrackerEnv

NAME, E = "posse/Tracker-v0", 3
SHORT: dict[str, Any] = {"horizon": 40}


@pytest.mark.parametrize("scenario", ["constant", "field"])
@pytest.mark.parametrize("discrete", [False, True])
def test_it_passes_gymnasiums_check(scenario: str, discrete: bool) -> None:
    env = gymnasium.make(NAME, scenario=scenario, discrete_actions=discrete, teammates="pursuit", **SHORT)
    check_env(env.unwrapped, skip_render_check=True)


def test_a_learner_that_acts_as_the_policy_would_changes_nothing() -> None:
    policy = load("ddcs-distributed")
    env = TrackerEnv("smart", number=2, silent=False, seed=5, **SHORT)
    own, _ = env.reset()
    batch = posse.batch("smart", 1, seed=5, message_size=policy.message_size, **SHORT)
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
    before = poses_of(env.batch.state, "tracker")
    for _ in range(10):
        env.step(np.array([1.0, 0.0], np.float32))
    moved = np.linalg.norm((poses_of(env.batch.state, "tracker") - before)[..., :2], axis=-1)[0]
    assert moved == pytest.approx([0, 1, 0, 0, 0], abs=1e-4)


def test_a_silent_learner_says_zeros() -> None:
    env = TrackerEnv("constant", number=0, teammates="ddcs-distributed", seed=3, **SHORT)
    assert env.action_space.shape == (2,)
    env.reset()
    for _ in range(5):
        env.step(np.zeros(2, np.float32))
    assert isinstance(env.batch, posse.PairedBatch)
    views = env.layout.views(env.batch.everyone[1].observations[0, 1])
    np.testing.assert_array_equal(views["neighbour_message"][views["neighbour_number"] == 0], 0)


def vector(**settings: Any) -> Any:
    return gymnasium.make_vec(NAME, E, vectorization_mode="vector_entry_point", **settings)


@pytest.mark.parametrize("make", [TrackerEnv, vector])
def test_what_cannot_be_played_is_refused(make: Any) -> None:
    with pytest.raises(ValueError, match="number=5 is not in the team"):
        make(scenario="constant", number=5)
    with pytest.raises(posse.ScenarioError, match="no team-mates"):
        make(scenario="constant", num_trackers=1)
    with pytest.raises(posse.ScenarioError, match="not possible in posse/Tracker-v0"):
        make(scenario="constant", target_motion="agent")
    with pytest.raises(PolicyError, match="unknown policy 'pursiut'"):
        make(scenario="constant", teammates="pursiut")


# --- many worlds -----------------------------------------------------------------------------------

SETTINGS: dict[str, Any] = {
    "scenario": "radio",
    "num_trackers": 3,
    "number": 1,
    "horizon": 14,
    "settle_time": 0.5,
    "terminate_on_contact": True,
    "start_distance": (1.0, 4.0),
    "breaks": 1,
    "break_window": (0.2, 0.4),
}


@pytest.mark.parametrize("mode", list(AutoresetMode), ids=lambda mode: mode.value)
@pytest.mark.parametrize("kind", [{}, {"silent": False}, {"discrete_actions": True}])
def test_many_worlds_agree_with_gymnasiums_own_vector_of_single_ones(
    mode: AutoresetMode, kind: dict[str, bool]
) -> None:
    settings = {**SETTINGS, **kind}
    ours = vector(autoreset=mode.name.lower(), **settings)
    makes = [lambda i=i: gymnasium.make(NAME, first_world=i, **settings) for i in range(E)]
    theirs: Any = SyncVectorEnv(makes, autoreset_mode=mode)
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    assert same(ours.reset(seed=6), theirs.reset(seed=[6] * E))
    ours.action_space.seed(0)
    ends = 0
    for _ in range(40):
        actions = ours.action_space.sample()
        mine, other = ours.step(actions), theirs.step(actions)
        for a, b in zip(mine[:4], other[:4], strict=True):
            assert a.dtype == b.dtype
            np.testing.assert_allclose(a, b, rtol=1e-12, atol=0)
        assert same(mine[4], other[4])
        ended = mine[2] | mine[3]
        ends += ended.sum()
        if mode is AutoresetMode.DISABLED and ended.any():
            options = {"reset_mask": ended}
            assert same(ours.reset(options=options), theirs.reset(options={"reset_mask": ended.copy()}))
    assert ends >= 2 * E


def test_a_refused_step_changes_nothing() -> None:
    one, other = (vector(seed=3, **SETTINGS) for _ in range(2))
    with pytest.raises(ResetNeeded):
        one.step(np.zeros((E, 2), np.float32))
    assert same(one.reset(), other.reset())
    for bad in (np.full((E, 2), 3.0), np.full((E, 2), np.nan), np.zeros((E, 3)), "left"):
        with pytest.raises(ValueError, match="action"):
            one.step(bad)
    actions = np.full((E, 2), 0.5, np.float32)
    for _ in range(5):
        assert same(one.step(actions), other.step(actions))
    env = TrackerEnv("constant", teammates="idle")
    with pytest.raises(ResetNeeded):
        env.step(np.zeros(2, np.float32))
    env.reset(seed=1)
    with pytest.raises(ValueError, match=r"actions\[0, 0, 0\] = nan"):
        env.step(np.array([np.nan, 0], np.float32))
