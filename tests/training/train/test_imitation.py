"""Imitation copies its expert."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.support.runs import HORIZON, assert_equal, numbers, quiet, small

import posse
from posse_baselines import BasePolicy, PolicyError
from posse_training.train.algorithms import ALGORITHMS
from posse_training.train.export import export
from posse_training.train.imitation import imitate
from posse_training.train.networks import Normaliser, RunningStatistics
from posse_training.train.train import train
from posse_training.train.worlds import make_env


class _Circle(BasePolicy):
    """An expert that is easy to imitate, with a message that the imitation does not observe."""

    name = "circle"
    message_size = 1

    def act(self, observations: Any, memory: Any) -> tuple[Any, Any]:
        side = memory.views(observations)["target_bearing"][..., 1]
        actions = np.stack([np.full_like(side, 0.5), 0.8 * side, np.ones_like(side)], axis=-1)
        return actions.astype(np.float32), memory


def test_imitation_copies(tmp_path: Path) -> None:
    settings = small(tmp_path, imitate="circle", imitate_rounds=4, encoding="plain")
    env = make_env(settings)
    model = ALGORITHMS[settings.algorithm].make(settings, env)
    errors: list[float] = []
    statistics = RunningStatistics(env.private_size)
    imitate(model, settings, env.encoding, _Circle(), statistics, lambda k, n, e: errors.append(e))
    assert len(errors) == 4
    assert errors[-1] < 0.02
    policy = export(model, settings, env.encoding, {})
    batch = posse.batch("constant", 20, num_trackers=2, horizon=HORIZON, settle_time=1.0, seed=99)
    observations = batch.reset()
    mine, _ = policy.act(observations, policy.begin(batch.layout, 20))
    side = batch.layout.views(observations)["target_bearing"][..., 1]
    assert np.abs(mine[..., 1] - 0.8 * side).mean() < 0.15
    # The statistics are those of the expert's observations.
    normaliser = next(m for m in model.policy.modules() if isinstance(m, Normaliser))
    np.testing.assert_allclose(normaliser.mean, statistics.mean, rtol=1e-5, atol=1e-6)


def test_a_training_can_begin_with_a_copy(tmp_path: Path) -> None:
    for name in "ab":
        train(small(tmp_path / name, imitate="pursuit", imitate_rounds=2), console=quiet())
    assert_equal(numbers(tmp_path / "a"), numbers(tmp_path / "b"))
    with pytest.raises(PolicyError, match="unknown policy"):
        train(small(tmp_path / "c", imitate="nobody"), console=quiet())
