"""The layers of a model, a copy of an expert, and what is exported."""

from pathlib import Path
from typing import Any
from unittest.mock import Mock, patch

import numpy as np
import pytest
import torch
from stable_baselines3 import PPO
from tests.support.runs import quiet, small

import posse
from posse_baselines import BasePolicy, load
from posse_baselines.learned import LearnedPolicy
from posse_training.train.algorithms import ALGORITHMS
from posse_training.train.checkpoint import read_checkpoint, restore_model
from posse_training.train.imitation import imitate
from posse_training.train.networks import Normaliser, RunningStatistics
from posse_training.train.train import train
from posse_training.train.worlds import make_env


def test_a_rollout_is_learned_from_with_its_own_statistics(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    means: list[Any] = []
    ratios: list[Any] = []
    original = PPO.train

    def look(self: PPO) -> None:
        normaliser = next(m for m in self.policy.modules() if isinstance(m, Normaliser))
        means.append(normaliser.mean.numpy().copy())
        buffer = self.rollout_buffer
        with torch.no_grad():
            seen, done = map(torch.as_tensor, (buffer.observations[0], buffer.actions[0]))
            _, log_prob, _ = self.policy.evaluate_actions(seen, done)
        ratios.append(np.abs(log_prob.numpy() - buffer.log_probs[0]).max())
        original(self)

    monkeypatch.setattr(PPO, "train", look)
    train(small(tmp_path), console=quiet())
    assert max(ratios) < 1e-5
    assert not np.array_equal(means[0], means[-1])


def test_statistics_forget_and_leave_out_what_does_not_vary() -> None:
    statistics = RunningStatistics(1)
    statistics.add(np.ones((4, 1), np.float32))
    assert statistics.scale == 0
    statistics.count = 5e6
    statistics.add(np.ones((4, 1), np.float32))
    assert statistics.count == 2e6


@pytest.mark.parametrize("hidden", [(8,), ()])
def test_the_state_changes_values_but_no_actions(tmp_path: Path, hidden: tuple[int, ...]) -> None:
    settings = small(tmp_path, "mappo", hidden=hidden)
    env = make_env(settings)
    policy: Any = ALGORITHMS["mappo"].make(settings, env).policy
    rows = torch.from_numpy(env.reset()).requires_grad_()
    policy.get_distribution(rows).distribution.mean.sum().backward()
    gradient: Any = rows.grad
    assert not gradient[:, env.encoding.size :].any()
    assert gradient[:, : env.encoding.size].any()
    other = rows.detach().clone()
    other[:, env.encoding.size :] += 5.0
    with torch.no_grad():
        assert (policy.predict_values(rows) - policy.predict_values(other)).abs().max() > 1e-4


class _Circle(BasePolicy):
    """An expert that is easy to imitate, with a message that the imitation does not observe."""

    name = "circle"
    message_size = 1

    def act(self, observations: Any, memory: Any) -> tuple[Any, Any]:
        assert memory.scenario.target_motion == "smart", "as in the training"
        side = memory.views(observations)["target_bearing"][..., 1]
        actions = np.stack([np.full_like(side, 0.5), 0.8 * side, np.ones_like(side)], axis=-1)
        return actions.astype(np.float32), memory

    def propose(self, observations: Any, memory: Any) -> tuple[Any, Any]:
        return self.act(observations, memory)[0][..., :2], memory

    def carry_out(self, observations: Any, memory: Any, corrections: Any) -> tuple[Any, Any]:
        return np.zeros((*corrections.shape[:2], 3), np.float32), memory  # its own safeguard is not copied


@pytest.mark.parametrize("guard", [False, True])
def test_imitation_copies(tmp_path: Path, guard: bool) -> None:
    settings = small(tmp_path, imitate="circle", imitate_rounds=4, encoding="plain", target="smart", safeguard=guard)
    env = make_env(settings)
    model: Any = ALGORITHMS[settings.algorithm].make(settings, env)
    errors: list[float] = []
    statistics, before = RunningStatistics(env.encoding.size), model.policy.value_net.weight.clone()
    imitate(model, settings, env.encoding, _Circle(), statistics, lambda line: errors.append(float(line.split()[-1])))
    assert len(errors) == 4
    assert errors[-1] < 0.02
    assert (model.policy.value_net.weight != before).any(), "of the first half of an episode"
    mine, _ = model.predict(rows := env.reset(), deterministic=True)
    side = env.batches[0].layout.views(rows)["target_bearing"][:, 1]
    assert np.abs(mine[:, 1] - 0.8 * side).mean() < 0.15
    # The statistics are those of the expert's observations.
    normaliser = next(m for m in model.policy.modules() if isinstance(m, Normaliser))
    np.testing.assert_allclose(normaliser.mean, statistics.mean, rtol=1e-5, atol=1e-6)


def test_an_imitated_expert_is_told_of_episodes_that_begin_anew(tmp_path: Path) -> None:
    expert, told = load("pursuit"), Mock(side_effect=lambda memory, mask: memory)
    settings = small(tmp_path, imitate="pursuit", imitate_rounds=1, overrides={"terminate_on_contact": True})
    env = make_env(settings)
    model = ALGORITHMS[settings.algorithm].make(settings, env)
    with patch.object(type(expert), "restart", told):
        imitate(model, settings, env.encoding, expert, RunningStatistics(env.encoding.size), lambda line: None)
    assert any(call.args[1].any() for call in told.call_args_list)


@pytest.mark.parametrize(
    "algorithm", ["ppo", "mappo", *(pytest.param(name, marks=pytest.mark.long) for name in ("sac", "td3"))]
)
def test_what_is_exported_acts_as_the_model_does(tmp_path: Path, algorithm: str) -> None:
    settings = small(tmp_path, algorithm, message_size=1)
    train(settings, console=quiet())
    env = make_env(settings)
    model = ALGORITHMS[settings.algorithm].make(settings, env)
    restore_model(model, read_checkpoint(tmp_path)["model"])
    policy = LearnedPolicy.from_file(tmp_path / "last.safetensors")
    batch = posse.Batch(env.batches[0].scenario, 4, seed=3)
    actions, _ = policy.act(batch.reset(), policy.begin(batch.layout, 4))
    expected, _ = model.predict(env.reset(), deterministic=True)
    np.testing.assert_allclose(actions.reshape(8, 3), expected, rtol=1e-4, atol=1e-4)
    assert np.ptp(expected) > 1e-3
