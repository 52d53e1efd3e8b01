"""The environments of Gymnasium and PettingZoo: what they return, when they end, what they refuse."""

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import render_test
from tests.support.adapters import f32

import posse
from posse.adapters.actions import MOTIONS

TEAM, SOLO = "posse/Team-v0", "posse/Solo-v0"


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


def test_pettingzoo_can_draw() -> None:
    render_test(posse.env)


def test_a_discrete_action_is_one_of_the_motions() -> None:
    plain = posse.parallel_env("smart")
    discrete = posse.parallel_env("smart", discrete_actions=True)
    plain.reset(seed=0)
    discrete.reset(seed=0)
    for k in range(15):
        chosen = {agent: (k + i) % 15 for i, agent in enumerate(plain.agents)}
        plain.step({agent: MOTIONS[number] for agent, number in chosen.items()})
        discrete.step(chosen)
        assert np.array_equal(plain.state(), discrete.state())


def test_settings_of_many_worlds_are_refused() -> None:
    with pytest.raises(posse.ScenarioError, match="num_worlds= is for many worlds"):
        posse.parallel_env(num_worlds=4)
