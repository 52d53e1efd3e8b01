"""An exported policy acts like its model."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.support.runs import ALGORITHM_CASES, quiet, small

import posse
from posse_baselines.learned import LearnedPolicy
from posse_training.train.algorithms import ALGORITHMS
from posse_training.train.checkpoint import read_checkpoint, restore_model
from posse_training.train.train import train
from posse_training.train.worlds import make_env


@pytest.mark.parametrize("algorithm", ALGORITHM_CASES)
def test_what_is_exported_acts_as_the_model_does(tmp_path: Path, algorithm: str) -> None:
    settings = small(tmp_path, algorithm)
    train(settings, console=quiet())
    env = make_env(settings)
    model = ALGORITHMS[settings.algorithm].make(settings, env)
    restore_model(model, read_checkpoint(tmp_path)["model"])
    policy = LearnedPolicy.from_file(tmp_path / "last.safetensors")
    batch = posse.Batch(settings.scenarios[0], 4, seed=3)
    actions, _ = policy.act(batch.reset(), policy.begin(batch.layout, 4))
    expected, _ = model.predict(env.reset(), deterministic=True)
    np.testing.assert_allclose(actions.reshape(8, 2), expected, rtol=1e-4, atol=1e-4)
    assert np.ptp(expected) > 1e-3
