"""Reward terms and their weighted sum against an independent computation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.support.adapters import part
from tests.support.reference.recordings import CASES, case_name, record
from tests.support.reference.score import Episode
from tests.support.reference.state import working

import posse


@pytest.mark.parametrize("case", CASES, ids=case_name)
def test_every_term_and_the_sum_equal_an_independent_working(case: Any) -> None:
    recording = record(*case)
    s, n = recording.scenario, recording.scenario.num_trackers
    episode = Episode(s)
    episode.follow(recording.states[0])
    for state, rewards, infos in zip(recording.states[1:], recording.rewards, recording.infos, strict=True):
        episode.follow(state)
        v = state["tracker_speed"] / s.tracker_speed
        turn = state["tracker_turn_rate"] / s.tracker_turn_rate
        # Who of two in one slot is said to hold it is left to the engine.
        own = state["tracker_slot"] >= 0
        expected: dict[str, Any] = {}
        if own.tolist() == [i in episode.occupied for i in range(n)]:
            expected = {"progress": episode.progress, "distance": episode.distance}
        expected |= {
            "slot": own,
            "sight": state["tracker_sees"],
            "contact": episode.onsets,
            "effort": (v**2 + turn**2) * working(state),
            "team": np.full(n, episode.score),
        }
        terms = part(infos, "reward/")
        for name, value in expected.items():
            np.testing.assert_allclose(terms[name][0], value, rtol=1e-4, atol=2e-4, err_msg=name)
        weights = dict(s.reward_weights)
        total = sum(weights.get(name, 0.0) * terms[name][0].astype(float) for name in terms)
        np.testing.assert_allclose(rewards, total, rtol=1e-5, atol=1e-5)


def test_terms_are_those_declared_and_weights_are_used() -> None:
    names = [term.name for term in posse.REWARD_TERMS]
    weights = {name: k + 0.5 for k, name in enumerate(names)}
    batch = posse.batch("obstacles", 4, reward_weights=weights)
    batch.reset(seed=1)
    rng = np.random.default_rng(1)
    for _ in range(20):
        _, rewards, _, _, infos = batch.step(rng.uniform(-1, 1, batch.action_shape))
        assert list(part(infos, "reward/")) == names
        total = sum(weights[name] * infos[f"reward/{name}"].astype(float) for name in names)
        np.testing.assert_allclose(rewards, total, rtol=1e-5, atol=1e-5)


def test_shaping_never_touches_the_score() -> None:
    plain, shaped = (posse.batch("smart", 4, reward_weights=weights) for weights in ({}, {"effort": -5.0}))
    plain.reset(seed=2)
    shaped.reset(seed=2)
    actions = np.random.default_rng(2).uniform(-1, 1, plain.action_shape)
    for _ in range(30):
        none, some = plain.step(actions), shaped.step(actions)
        np.testing.assert_array_equal(none[-1]["score"], some[-1]["score"])
        assert (none[1] == 0).all()
        assert (some[1] < 0).all()


def test_a_target_that_is_an_agent_gets_the_opposite_of_the_score() -> None:
    batch = posse.batch(target_motion="agent", num_trackers=2, start_distance=(0.5, 2.5))
    batch.reset(seed=3)
    for _ in range(50):
        _, rewards, _, _, infos = batch.step(np.full(batch.action_shape, -0.5))
        assert rewards.shape == (1, 3)
        assert rewards[0, 2] == -infos["score"][0]
        terms = {name: values[0, 2] for name, values in part(infos, "reward/").items()}
        assert terms["team"] == infos["score"][0]
        assert all(terms[name] == 0 for name in ("slot", "progress", "distance", "sight"))


def test_the_start_of_an_episode_rewards_nothing() -> None:
    batch = posse.batch(horizon=3, settle_time=0.2)
    batch.reset()
    for _ in range(3):
        ended = batch.step(np.zeros(batch.action_shape))
    assert ended[3].all()
    _, rewards, terminated, truncated, infos = batch.step(np.zeros(batch.action_shape))
    assert (rewards == 0).all()
    assert not terminated.any()
    assert not truncated.any()
    assert all((term == 0).all() for term in part(infos, "reward/").values())
