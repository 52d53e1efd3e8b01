"""The PettingZoo environments: what they return, when they end, and their actions."""

from __future__ import annotations

import numpy as np
import pettingzoo
import pytest
from pettingzoo.test import render_test
from tests.support.adapters import f32

import posse
from posse.adapters.actions import MOTIONS
from posse.adapters.pettingzoo_env import TeamParallelEnv


def test_pettingzoo_can_draw(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    render_test(posse.env)
    env = posse.parallel_env(render_mode="human")
    env.reset(seed=0)
    assert env.render() is None
    env.close()
    env.close()


def test_a_discrete_action_is_one_of_the_motions() -> None:
    plain = posse.parallel_env("smart")
    discrete = posse.parallel_env("smart", discrete_actions=True)
    plain.reset(seed=0)
    discrete.reset(seed=0)
    assert discrete.action_space("tracker_0").n == len(MOTIONS) == 15  # type: ignore[attr-defined]
    for k in range(15):
        chosen = {agent: (k + i) % 15 for i, agent in enumerate(plain.agents)}
        plain.step({agent: MOTIONS[number] for agent, number in chosen.items()})
        discrete.step(chosen)
        assert np.array_equal(plain.state(), discrete.state())
    for number, motion in enumerate(MOTIONS):
        assert tuple(motion) == (number // 5 - 1, (number % 5 - 2) / 2)


@pytest.mark.skipif(not hasattr(pettingzoo, "parallel_registry"), reason="PettingZoo has a registry since 1.27")
def test_the_registry_makes_both_kinds() -> None:
    parallel = pettingzoo.make("parallel", "posse/track-v0", scenario="smart", num_trackers=3)
    assert isinstance(parallel, TeamParallelEnv)
    assert len(parallel.possible_agents) == 3
    assert isinstance(pettingzoo.make("aec", "posse/track-v0", horizon=5), pettingzoo.AECEnv)


def test_turns_move_the_world_when_all_have_acted() -> None:
    parallel, turns = posse.parallel_env("smart"), posse.env("smart")
    parallel.reset(seed=0)
    turns.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(10):
        before = turns.state()
        actions = {a: rng.uniform(-1, 1, 2).astype(np.float32) for a in parallel.agents}
        for agent in parallel.agents:
            assert np.array_equal(turns.state(), before)
            assert turns.agent_selection == agent
            turns.step(actions[agent])
        parallel.step(actions)
        assert np.array_equal(turns.state(), parallel.state())


def test_turns_check_all_actions_when_the_last_has_acted() -> None:
    env = posse.env(num_trackers=2)
    env.reset(seed=0)
    before = env.state()
    env.step(f32([2, 0]))
    with pytest.raises(ValueError, match=r"tracker_0: speed = 2\.0 .*clip_actions=True"):
        env.step(f32([1, 0]))
    assert np.array_equal(env.state(), before)
