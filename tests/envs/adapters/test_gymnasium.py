"""`posse/Team-v0` and `posse/Solo-v0`: what they return, when they end, what they refuse."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from tests.support.adapters import f32, part

import posse

TEAM, SOLO = "posse/Team-v0", "posse/Solo-v0"
BREAKING = [name for name in posse.scenario_names() if posse.get_scenario(name).breaks > 0]


@pytest.fixture(autouse=True)
def _no_window(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")


@pytest.mark.parametrize("name", [TEAM, SOLO])
def test_gymnasium_finds_the_drawing_sound(name: str) -> None:
    check_env(gymnasium.make(name, scenario="smart").unwrapped)


def test_a_team_is_the_first_world_of_a_batch() -> None:
    env = gymnasium.make(TEAM, scenario="field", split="validation", first_world=5)
    batch = posse.batch("field", 3, split="validation", first_world=5)
    observation, _ = env.reset(seed=9)
    batch_observations = batch.reset(seed=9)
    rng = np.random.default_rng(0)
    for _ in range(30):
        assert np.array_equal(observation, batch_observations[0])
        actions = rng.uniform(-1, 1, batch.action_shape).astype(np.float32)
        observation, reward, _, _, info = env.step(actions[0])
        batch_observations, rewards, _, _, infos = batch.step(actions)
        assert reward == pytest.approx(rewards[0].mean(), rel=1e-5, abs=1e-6)
        assert info["score"] == infos["score"][0]
        for term, values in part(infos, "reward/").items():
            assert np.array_equal(info[f"reward/{term}"], values[0])


def test_a_solo_is_a_team_of_one() -> None:
    solo = gymnasium.make(SOLO, scenario="smart")
    team = gymnasium.make(TEAM, scenario="smart", num_trackers=1)
    ours, theirs = solo.reset(seed=3)[0], team.reset(seed=3)[0]
    for k in range(30):
        assert np.array_equal(ours, theirs[0])
        action = f32([np.cos(k), np.sin(k)])
        ours, reward, _, _, info = solo.step(action)
        theirs, team_reward, _, _, team_info = team.step(action[None])
        assert reward == team_reward
        for term, value in part(info, "reward/").items():
            assert value == team_info[f"reward/{term}"][0]


def test_without_a_seed_environments_differ() -> None:
    first, second = gymnasium.make(TEAM), gymnasium.make(TEAM)
    assert not np.array_equal(first.reset()[0], second.reset()[0])
    assert np.array_equal(gymnasium.make(TEAM, seed=4).reset()[0], second.reset(seed=4)[0])


def test_contact_terminates_where_it_is_asked_for() -> None:
    for name, action in ((TEAM, f32([[1, 0]])), (SOLO, f32([1, 0]))):
        settings: dict[str, Any] = {"num_trackers": 1, "target_speed": 0.0}
        env = gymnasium.make(name, terminate_on_contact=True, **settings)
        env.reset(options={"tracker_pose": [[-1.0, 0, 0]], "target_pose": [0.0, 0, 0]})
        ends = [env.step(action)[2:4] for _ in range(7)]
        assert ends == [(False, False)] * 6 + [(True, False)]


@pytest.mark.parametrize("scenario", BREAKING)
def test_solo_says_why_it_cannot_play(scenario: str) -> None:
    with pytest.raises(posse.ScenarioError, match=rf"{scenario!r} does not fit posse/Solo-v0.*"):
        gymnasium.make(SOLO, scenario=scenario)
    gymnasium.make(SOLO, scenario=scenario, breaks=0).reset(seed=0)
