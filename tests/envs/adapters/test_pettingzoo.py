"""The PettingZoo environments: what they return, when they end, and their actions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pettingzoo
import pytest
from pettingzoo.test import render_test
from tests.support.adapters import f32, part

import posse
from posse.adapters.actions import MOTIONS
from posse.adapters.pettingzoo_env import TeamParallelEnv
from posse_baselines import load_target


def play(env: TeamParallelEnv, steps: int, seed: int = 3) -> list[Any]:
    """Play with actions drawn from a seed; return all results."""
    rng = np.random.default_rng(seed)
    returned: list[Any] = []
    for _ in range(steps):
        if not env.agents:
            returned.append(env.reset())
        actions = {agent: rng.uniform(-1, 1, env.action_space(agent).shape).astype(np.float32) for agent in env.agents}
        returned.append(env.step(actions))
    return returned


def test_pettingzoo_can_draw(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    render_test(posse.env)
    env = posse.parallel_env(render_mode="human")
    env.reset(seed=0)
    assert env.render() is None
    env.close()
    env.close()


def test_a_target_that_is_an_agent_goes_where_it_wants() -> None:
    ahead, circling = f32([1, 0]), f32([1, 1])
    rest = {f"tracker_{i}": f32([-1, 0]) for i in range(5)}
    places = []
    for action in (ahead, circling):
        env = posse.parallel_env("constant", target_motion="agent")
        env.reset(seed=1)
        before = env.state_layout.views(env.state())
        start = np.array([before["target_x"], before["target_y"]])
        for _ in range(50):
            _, rewards, *_ = env.step({**rest, "target_0": action})
        after = env.state_layout.views(env.state())
        places.append(np.hypot(*(np.array([after["target_x"], after["target_y"]]) - start)))
        assert rewards["target_0"] == 0.0  # nobody holds a slot
    assert places[0] == pytest.approx(0.6 * 5, rel=1e-4)
    # ω = 1 rad/s at 0.6 m/s for 5 s: the chord of a circle of 0.6 m.
    assert places[1] == pytest.approx(2 * 0.6 * abs(np.sin(2.5)), rel=1e-3)


def test_an_environment_is_the_first_world_of_a_batch() -> None:
    for first_world in (0, 3):
        env = posse.parallel_env("field", split="test", first_world=first_world)
        batch = posse.batch("field", 2, seed=11, split="test", first_world=first_world)
        ours, theirs = env.reset(seed=11)[0], batch.reset()
        rng = np.random.default_rng(0)
        for _ in range(30):
            for i, agent in enumerate(env.agents):
                assert np.array_equal(ours[agent], theirs[0, i])
            actions = rng.uniform(-1, 1, batch.action_shape).astype(np.float32)
            ours, rewards, *_, infos = env.step(dict(zip(env.agents, actions[0], strict=True)))
            theirs, batch_rewards, _, _, batch_infos = batch.step(actions)
            assert list(rewards.values()) == batch_rewards[0].tolist()
            for i, agent in enumerate(env.agents):
                info = infos[agent]
                assert info["score"] == batch_infos["score"][0]
                for name, values in part(batch_infos, "reward/").items():
                    assert info[f"reward/{name}"] == values[0, i]


def test_the_end_is_told_once_with_every_metric() -> None:
    env = posse.parallel_env(horizon=6, settle_time=0.3)
    env.reset(seed=0)
    *before, last = play(env, 6)
    for _, _, terminations, truncations, infos in before:
        assert not any(terminations.values())
        assert not any(truncations.values())
        assert all(set(part(info, "metrics/").values()) == {0.0} for info in infos.values())
    _, _, terminations, truncations, infos = last
    assert not any(terminations.values())
    assert all(truncations.values())
    assert env.agents == []
    for info in infos.values():
        assert list(part(info, "metrics/")) == [metric.name for metric in posse.METRICS]
        scores = [step[-1]["tracker_0"]["score"] for step in (*before, last)]
        assert info["metrics/score"] == pytest.approx(np.mean(scores))


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


def test_a_policy_moves_the_target_as_in_a_batch() -> None:
    env = posse.parallel_env("duel", target_policy=load_target("evader").policy)
    batch = posse.batch("duel", target_policy=load_target("evader").policy)
    env.reset(seed=0)
    batch.reset(seed=0)
    assert env.agents == env.possible_agents == [f"tracker_{i}" for i in range(5)]
    for _ in range(5):
        actions = np.full((1, 5, 2), 0.5, np.float32)
        seen = env.step(dict(zip(env.agents, actions[0], strict=True)))[0]
        np.testing.assert_array_equal(list(seen.values()), batch.step(actions)[0][0])
