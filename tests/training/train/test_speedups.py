"""The faster parts of PPO agree with those of the libraries."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch
from gymnasium import spaces
from stable_baselines3.common.buffers import RolloutBuffer
from torch import nn

from posse_training.train.networks import FlatRolloutBuffer, QuickTanh


def test_it_is_the_hyperbolic_tangent() -> None:
    x = torch.cat([torch.linspace(-12, 12, 100_001), torch.tensor([0.0, 90.0, -90.0, 1e-6])])
    before = x.clone()
    y = QuickTanh()(x)
    np.testing.assert_allclose(y.numpy(), np.tanh(x.double().numpy()), rtol=0, atol=3e-7)
    assert torch.equal(x, before)
    assert y.abs().max() == 1.0
    ends = QuickTanh()(torch.tensor([np.inf, -np.inf, np.nan]))
    np.testing.assert_array_equal(ends.numpy(), [1, -1, np.nan])


def test_its_derivative_is_that_of_the_tangent() -> None:
    x = torch.randn(500, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(QuickTanh(), x)


def test_a_network_learns_the_same_with_it() -> None:
    gradients = []
    for activation in (nn.Tanh(), QuickTanh()):
        torch.manual_seed(3)
        network = nn.Sequential(nn.Linear(7, 16), activation, nn.Linear(16, 1))
        inputs = torch.randn(64, 7)
        network(inputs).square().mean().backward()
        gradients.append([p.grad.clone() for p in network.parameters() if p.grad is not None])
    assert len(gradients[0]) == 4
    for exact, quick in zip(*gradients, strict=True):
        torch.testing.assert_close(quick, exact, rtol=1e-4, atol=1e-6)


def filled(kind: type[RolloutBuffer]) -> Any:
    box = spaces.Box(-1, 1, (3,), np.float32)
    buffer = kind(6, box, spaces.Box(-1, 1, (2,), np.float32), "cpu", 0.9, 0.8, n_envs=4)
    generator = np.random.default_rng(0)
    for _ in range(6):
        draw = generator.normal(size=(4, 9)).astype(np.float32)
        buffer.add(
            draw[:, :3],
            draw[:, 3:5],
            draw[:, 5],
            draw[:, 6] > 1,
            torch.from_numpy(draw[:, 7:8]),
            torch.from_numpy(draw[:, 8]),
        )
    buffer.compute_returns_and_advantage(torch.ones(4), np.array([True, False, False, True]))
    return buffer


def rows(buffer: Any, size: int | None) -> Any:
    parts = [
        np.concatenate([np.asarray(p).reshape(len(batch.observations), -1) for p in batch], axis=1)
        for batch in buffer.get(size)
    ]
    together = np.concatenate(parts)
    return together[np.lexsort(together.T)], [len(part) for part in parts]


@pytest.mark.parametrize("size", [None, 24, 8, 7])
def test_rows_are_those_of_the_library(size: int | None) -> None:
    mine, sizes = rows(filled(FlatRolloutBuffer), size)
    theirs, wanted = rows(filled(RolloutBuffer), size)
    np.testing.assert_array_equal(mine, theirs)
    assert sizes == wanted


def test_passes_differ_in_order() -> None:
    buffer = filled(FlatRolloutBuffer)
    first, second = (next(buffer.get(24)).observations for _ in range(2))
    assert not torch.equal(first, second)


def test_an_incomplete_rollout_is_refused() -> None:
    box = spaces.Box(-1, 1, (3,), np.float32)
    with pytest.raises(RuntimeError, match="complete"):
        next(FlatRolloutBuffer(6, box, box).get(2))
