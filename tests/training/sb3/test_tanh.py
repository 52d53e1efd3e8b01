"""The tangent that networks are trained with is the tangent."""

from __future__ import annotations

import numpy as np
import torch
from torch import nn

from posse_training.sb3.tanh import QuickTanh


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
