"""`posse/Team-v0` and `posse/Solo-v0`: what they return, when they end, what they refuse."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from tests.support.adapters import f32

import posse

TEAM, SOLO = "posse/Team-v0", "posse/Solo-v0"
BREAKING = [name for name in posse.scenario_names() if posse.get_scenario(name).breaks > 0]


@pytest.fixture(autouse=True)
def _no_window(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")


@pytest.mark.parametrize("name", [TEAM, SOLO])
def test_gymnasium_finds_the_drawing_sound(name: str) -> None:
    check_env(gymnasium.make(name, scenario="smart").unwrapped)


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
