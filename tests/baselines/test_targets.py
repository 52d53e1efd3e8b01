"""Targets by name and file, errors for unknown ones, and matches of two policies."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.support.learned import any_policy, target_for

import posse
from posse_baselines import Match, PolicyError, against, load, load_target, play, target_names

SHORT = posse.get_scenario("smart", num_trackers=3, horizon=30, settle_time=1.0)


FORWARD, STILL = np.array([1, 0], np.float32), np.array([-1, 0], np.float32)


class Straight:
    """A target of one's own, which drives straight on."""

    def begin(self, layout: posse.ObservationLayout, num_worlds: int) -> Any:
        return None

    def act(self, observations: Any, memory: Any) -> Any:
        return np.tile(FORWARD, (*observations.shape[:2], 1)), memory

    def restart(self, memory: Any, mask: Any) -> Any:
        return memory


CODE = f"{__name__}:Straight"


def test_a_scripted_target_is_the_scenarios_motion() -> None:
    assert set(target_names()) >= {"constant", "accelerating", "smart"}
    assert "agent" not in target_names()
    target = load_target("accelerating")
    assert target.fit(SHORT) == SHORT.replace(target_motion="accelerating")
    assert load_target(target) is target
    policy = load("pursuit")
    assert against(policy, target) is policy


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "evader.safetensors"
    target_for(SHORT).save(path)
    return path


def test_a_target_plays_the_same_inside_a_batch_and_in_a_match(file: Path) -> None:
    for text in (str(file), CODE):
        target = load_target(text)
        scenario = target.fit(SHORT)
        assert target.policy is not None
        inside = posse.batch(SHORT, 4, seed=2, target_policy=target.policy)
        match = against(load("pursuit"), target)
        beside = play(posse.Batch(scenario, 4, seed=2), match)
        for name, column in play(inside, load("pursuit")).items():
            np.testing.assert_array_equal(column, beside[name], name)
    assert match.name == "pursuit"


def test_a_target_of_ones_own_moves_the_target() -> None:
    batch = posse.batch(SHORT, 2, target_policy=load_target(CODE).policy)
    batch.reset()
    x, y = batch.worlds["x"].copy(), batch.worlds["y"].copy()
    for _ in range(10):
        batch.step(np.tile(STILL, (2, 3, 1)))
    way = np.hypot(batch.worlds["x"] - x, batch.worlds["y"] - y)
    np.testing.assert_allclose(way, SHORT.target_speed, rtol=1e-4)


def test_the_sides_are_not_mixed_up(file: Path, tmp_path: Path) -> None:
    with pytest.raises(PolicyError, match=r"policy of a target: give it as target="):
        load(file)
    team = tmp_path / "team.safetensors"
    any_policy().save(team)
    with pytest.raises(PolicyError, match="policy of a team, 'mine'"):
        load_target(team)
    evader = load_target(file)
    with pytest.raises(PolicyError, match="plays the target's motion ahead"):
        Match(load("planner"), evader)
    with pytest.raises(PolicyError, match="a motion of the scenario"):
        Match(load("pursuit"), load_target("smart"))
    with pytest.raises(PolicyError, match="give a target too"):
        play(posse.Batch(evader.fit(SHORT), 1), load("pursuit"))


class Broken(Straight):
    def act(self, observations: Any, memory: Any) -> Any:
        return np.zeros((1, 1)), memory


def test_wrong_actions_of_a_target_are_named() -> None:
    target = load_target(f"{__name__}:Broken")
    with pytest.raises(PolicyError, match=r"Broken.*shape \(1, 1\)"):
        play(posse.Batch(target.fit(SHORT), 2), against(load("idle"), target))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("smrat", "did you mean 'smart'"),
        ("agent", "unknown target 'agent'"),
        (__file__, r"must end in .safetensors"),
        ("posse_baselines:load", "lacks begin, act, restart"),
        ("a\0b", "unknown target"),
    ],
)
def test_an_unknown_target_is_refused(text: str, message: str) -> None:
    with pytest.raises(PolicyError, match=message):
        load_target(text)
