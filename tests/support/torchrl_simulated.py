"""Tests of TorchRL over the GPU engine in numba's simulator: test_torchrl_env.py starts them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch
from tensordict import TensorDictBase
from torchrl.envs.utils import check_env_specs

import posse
from posse.engine.cuda import CudaBatch
from posse_training.torchrl import env as torchrl_env

SHORT: dict[str, Any] = {"horizon": 4, "settle_time": 0.2, "num_trackers": 2}


@pytest.fixture
def simulated(monkeypatch: pytest.MonkeyPatch) -> None:
    """Use the GPU engine in environments, with tensors on the CPU."""

    def batch(name: str, num_worlds: int, *, device: str, **settings: Any) -> posse.Batch:
        return CudaBatch(posse.get_scenario(name, **SHORT), num_worlds, **settings)

    monkeypatch.setattr(posse, "batch", batch)


def played(env: torchrl_env.PosseEnv) -> list[TensorDictBase]:
    rng = np.random.default_rng(3)
    carried, made = env.reset(), []
    for _ in range(10):
        actions = rng.uniform(-1, 1, env.batch.action_shape).astype(np.float32)
        carried["agents", "action"] = torch.from_numpy(actions)
        following, carried = env.step_and_maybe_reset(carried)
        made.append(following["next"])
    return made


def test_rollouts_are_those_of_the_cpu(request: pytest.FixtureRequest) -> None:
    cpu = torchrl_env.PosseEnv("smart", 2, seed=5, **SHORT)
    expected = played(cpu)
    request.getfixturevalue("simulated")
    env = torchrl_env.PosseEnv("smart", 2, seed=5)
    assert isinstance(env.batch, CudaBatch)
    # All steps are kept until the end, to detect memory that the engine overwrites.
    for made, wanted in zip(played(env), expected, strict=True):
        for key in wanted.keys(include_nested=True, leaves_only=True):
            np.testing.assert_allclose(made[key].numpy(), wanted[key].numpy(), 1e-4, 1e-5)


@pytest.mark.usefixtures("simulated")
def test_specs_hold() -> None:
    check_env_specs(torchrl_env.PosseEnv("smart", 2, seed=5), seed=1)
