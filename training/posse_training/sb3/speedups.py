"""Two parts of PPO that are faster than the libraries' own; results agree to rounding.

Measured in PPO on ``smart``, one thread for torch: with ``nn.Tanh`` a rollout and its updates take
2 to 13 % longer, with stable-baselines3's buffer 5 to 10 %.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Any, Final, cast

import numpy as np
import torch
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.type_aliases import RolloutBufferSamples
from torch import nn


class _TanhByLogistic(torch.autograd.Function):
    """tanh x = 2 σ(2x) - 1, with the derivative 1 - tanh² x."""

    @staticmethod
    def forward(context: Any, x: torch.Tensor) -> torch.Tensor:
        y = torch.mul(x, 2).sigmoid_().mul_(2).sub_(1)
        context.save_for_backward(y)
        return y

    @staticmethod
    def backward(context: Any, gradient: torch.Tensor) -> torch.Tensor:
        (y,) = context.saved_tensors
        return cast("torch.Tensor", torch.ops.aten.tanh_backward(gradient, y))


class QuickTanh(nn.Tanh):
    """``nn.Tanh`` to within 3e-7, computed from the logistic function in half the time."""

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Return tanh x, of the same shape."""
        return cast("torch.Tensor", _TanhByLogistic.apply(x))  # type: ignore[no-untyped-call]


_PARTS: Final = ("observations", "actions", "values", "log_probs", "advantages", "returns")


class FlatRolloutBuffer(RolloutBuffer):
    """A rollout buffer without copies; torch gathers the minibatches.

    Minibatches are those of stable-baselines3's buffer with rows numbered by time first, in an
    order drawn from numpy's global generator; each row occurs once a pass.
    """

    def add(
        self, obs: Any, action: Any, reward: Any, episode_start: Any, value: torch.Tensor, log_prob: torch.Tensor
    ) -> None:
        """Store one step of every slot."""
        self.observations[self.pos] = obs
        self.actions[self.pos] = action.reshape(self.n_envs, self.action_dim)
        self.rewards[self.pos] = reward
        self.episode_starts[self.pos] = episode_start
        self.values[self.pos] = value.cpu().numpy().reshape(-1)
        self.log_probs[self.pos] = log_prob.cpu().numpy().reshape(-1)
        self.pos += 1
        self.full = self.pos == self.buffer_size

    def get(self, batch_size: int | None = None) -> Generator[RolloutBufferSamples, None, None]:
        """Yield minibatches of ``batch_size`` rows; default: all rows at once.

        Raises:
            RuntimeError: The rollout is not complete.
        """
        if not self.full:
            raise RuntimeError("the rollout must be complete before minibatches are drawn from it")
        rows = self.buffer_size * self.n_envs
        order = torch.from_numpy(np.random.permutation(rows))  # noqa: NPY002 (as SB3 does)
        tensors = []
        for name in _PARTS:
            array = getattr(self, name)
            flat = array.reshape(rows, -1) if array.ndim > 2 else array.reshape(rows)
            tensors.append(torch.from_numpy(flat))
        for chosen in torch.split(order, batch_size or rows):
            yield RolloutBufferSamples(*(t.index_select(0, chosen) for t in tensors))
