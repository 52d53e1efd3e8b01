"""Input statistics, and their use during a rollout."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from stable_baselines3 import PPO
from tests.support.runs import quiet, small

from posse_training.train.networks import Normaliser, RunningStatistics
from posse_training.train.train import train


def test_adding_in_parts_is_adding_at_once() -> None:
    rows = np.random.default_rng(0).normal(3, 2, (500, 4)).astype(np.float32)
    statistics = RunningStatistics(4)
    for part in np.split(rows, [1, 50, 300]):
        statistics.add(part)
    np.testing.assert_allclose(statistics.mean, rows.mean(axis=0), rtol=1e-5)
    np.testing.assert_allclose(statistics.variance, rows.var(axis=0), rtol=1e-5)
    np.testing.assert_allclose(statistics.scale, 1 / rows.std(axis=0), rtol=1e-5)


def test_what_never_varies_says_nothing() -> None:
    statistics = RunningStatistics(1)
    statistics.add(np.full((10, 1), 7.0, np.float32))
    assert statistics.scale == 0


def test_a_rollout_is_learned_from_with_the_numbers_it_was_played_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    means: list[Any] = []
    ratios: list[Any] = []
    original = PPO.train

    def look(self: PPO) -> None:
        normaliser = next(m for m in self.policy.modules() if isinstance(m, Normaliser))
        means.append(normaliser.mean.numpy().copy())
        buffer = self.rollout_buffer
        with torch.no_grad():
            _, log_prob, _ = self.policy.evaluate_actions(
                torch.as_tensor(buffer.observations[0]), torch.as_tensor(buffer.actions[0])
            )
        ratios.append(np.abs(log_prob.numpy() - buffer.log_probs[0]).max())
        original(self)

    monkeypatch.setattr(PPO, "train", look)
    train(small(tmp_path), console=quiet())
    assert max(ratios) < 1e-5
    assert not np.array_equal(means[0], means[-1])
