"""PPO on TorchRL: data of the engine, correct formulas, and learning."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch

import posse
from posse_training.torchrl.agent import ACTION, DRAWN, OBSERVATION, REWARD_NEXT, VALUE, Agent, RunningScale
from posse_training.torchrl.env import TRACKERS, PosseEnv
from posse_training.torchrl.ppo import Settings, objectives, roll_out, spread_flags, train

SHORT: dict[str, Any] = {"horizon": 10, "settle_time": 0.5, "start_distance": (1.0, 2.5)}
SMALL = Settings(num_worlds=16, rollout_steps=10, updates=2, minibatches=2, hidden=(8,))


def an_agent_and_its_rollout(steps: int, **settings: Any) -> tuple[Agent, Any]:
    torch.manual_seed(0)
    env = PosseEnv("constant", 16, **SHORT, **settings)
    agent = Agent(env, (16,))
    rollout, _ = roll_out(env, agent.actor, env.reset(), steps)
    return agent, rollout


def test_a_rollout_is_what_the_batch_did() -> None:
    _, rollout = an_agent_and_its_rollout(25)
    batch = posse.batch("constant", 16, autoreset="disabled", **SHORT)
    observations = batch.reset()
    for t in range(25):
        np.testing.assert_array_equal(rollout[OBSERVATION][:, t].numpy(), observations)
        observations, rewards, _, truncated, _ = batch.step(rollout[ACTION][:, t].numpy())
        following = rollout["next", TRACKERS, "observation"][:, t]
        np.testing.assert_array_equal(following.numpy(), observations)
        np.testing.assert_array_equal(rollout[REWARD_NEXT][:, t, :, 0].numpy(), rewards)
        if truncated.any():
            observations = batch.reset()


def test_actions_are_drawn_and_cut_to_the_space() -> None:
    _, rollout = an_agent_and_its_rollout(10)
    assert 0.9 < rollout[DRAWN].std() < 1.1
    assert torch.equal(rollout[ACTION], rollout[DRAWN].clamp(-1, 1))


def test_advantages_bootstrap_what_was_truncated_and_not_what_was_terminated() -> None:
    agent, rollout = an_agent_and_its_rollout(20, terminate_on_contact=True)
    terminated = rollout["next", "terminated"][:, :, None].float()
    truncated = rollout["next", "truncated"][:, :, None].float()
    settings = Settings(discount=0.9, trace=0.8)
    _, advantage = objectives(agent, settings)
    spread_flags(rollout)
    with torch.no_grad():
        advantage(rollout)
        value = agent.critic.module(rollout[OBSERVATION])
        value_next = agent.critic.module(rollout["next", TRACKERS, "observation"])
    assert terminated.any()
    assert truncated.any()
    expected = torch.zeros_like(value)
    later = torch.zeros_like(value[:, 0])
    for t in reversed(range(20)):
        goes_on = 1 - torch.maximum(terminated, truncated)[:, t]
        surprise = rollout[REWARD_NEXT][:, t] + 0.9 * value_next[:, t] * (1 - terminated[:, t]) - value[:, t]
        later = surprise + 0.9 * 0.8 * goes_on * later
        expected[:, t] = later
    torch.testing.assert_close(rollout["advantage"], expected)
    torch.testing.assert_close(rollout[VALUE], value)


def test_before_any_update_no_probability_has_changed() -> None:
    agent, rollout = an_agent_and_its_rollout(5)
    loss, advantage = objectives(agent, Settings())
    spread_flags(rollout)
    with torch.no_grad():
        advantage(rollout)
        losses = loss(rollout.reshape(-1))
    assert losses["max_ratio"] == pytest.approx(1.0, abs=1e-5)
    assert losses["loss_objective"] == pytest.approx(-rollout["advantage"].mean().item(), abs=1e-5)


def test_the_running_scale_is_that_of_all_that_was_seen() -> None:
    scale = RunningScale(3)
    parts = [torch.randn(n, 3) * torch.tensor([1.0, 5.0, 0.1]) + 4 for n in (7, 50, 13)]
    for part in parts:
        scale.update(part)
    together = torch.cat(parts)
    torch.testing.assert_close(scale.mean, together.mean(0))
    torch.testing.assert_close(scale.variance, together.var(0, correction=0))
    scaled = scale(together)
    torch.testing.assert_close(scaled.mean(0), torch.zeros(3), atol=1e-4, rtol=0)
    assert "scale.mean" in dict(an_agent_and_its_rollout(1)[0].state_dict())


def test_the_same_seed_gives_the_same_agent() -> None:
    reports: list[dict[str, float]] = []
    one = train("constant", SMALL, report=reports.append, **SHORT).state_dict()
    two = train("constant", SMALL, **SHORT).state_dict()
    other = Settings(**{**SMALL.__dict__, "seed": 1})
    three = train("constant", other, **SHORT).state_dict()
    assert all(torch.equal(one[name], two[name]) for name in one)
    assert any(not torch.equal(one[name], three[name]) for name in one)
    assert all(np.isfinite(list(report.values())).all() for report in reports)
    assert [report["agent_steps"] for report in reports] == [800, 1600]


@pytest.mark.long
def test_it_learns_to_close_in() -> None:
    settings = Settings(num_worlds=32, rollout_steps=50, updates=12, minibatches=2, learning_rate=1e-3, discount=0.95)
    rewards: list[float] = []
    train(
        "constant",
        settings,
        report=lambda figures: rewards.append(figures["reward"]),
        horizon=50,
        target_speed=0.2,
        start_distance=(1.5, 3.0),
    )
    assert np.mean(rewards[-3:]) > 1.5 * np.mean(rewards[:3])


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("num_worlds", 0),
        ("updates", -1),
        ("learning_rate", 0.0),
        ("discount", 1.5),
        ("trace", -0.1),
        ("entropy", -1.0),
        ("hidden", (64, 0)),
        ("seed", -1),
    ],
)
def test_impossible_settings_are_refused(name: str, value: Any) -> None:
    with pytest.raises(ValueError, match=f"{name}="):
        Settings(**{name: value})
