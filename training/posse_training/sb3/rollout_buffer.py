"""A rollout as stable-baselines3 keeps one, without its copies: torch gathers the minibatches."""

from __future__ import annotations

from collections.abc import Generator
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.type_aliases import RolloutBufferSamples

_PARTS = ("observations", "actions", "values", "log_probs", "advantages", "returns")


class FlatRolloutBuffer(RolloutBuffer):
    """Yields minibatches as stable-baselines3's buffer does, rows being numbered in time first.

    Every row comes once a pass, in an order drawn from numpy's global generator.
    """

    def add(
        self,
        obs: Any,
        action: Any,
        reward: Any,
        episode_start: Any,
        value: torch.Tensor,
        log_prob: torch.Tensor,
    ) -> None:
        """Take one step of every slot."""
        self.observations[self.pos] = obs
        self.actions[self.pos] = action.reshape(self.n_envs, self.action_dim)
        self.rewards[self.pos] = reward
        self.episode_starts[self.pos] = episode_start
        self.values[self.pos] = value.cpu().numpy().reshape(-1)
        self.log_probs[self.pos] = log_prob.cpu().numpy().reshape(-1)
        self.pos += 1
        self.full = self.pos == self.buffer_size

    def get(self, batch_size: int | None = None) -> Generator[RolloutBufferSamples, None, None]:
        """Yield minibatches of ``batch_size`` rows; default: all rows at once."""
        if not self.full:
            raise RuntimeError("a rollout is learned from once it is complete")
        rows = self.buffer_size * self.n_envs
        order = torch.from_numpy(np.random.permutation(rows))  # noqa: NPY002 (as SB3 does)
        tensors = []
        for name in _PARTS:
            array = getattr(self, name)
            flat = array.reshape(rows, -1) if array.ndim > 2 else array.reshape(rows)
            tensors.append(torch.from_numpy(flat))
        for chosen in torch.split(order, batch_size or rows):
            yield RolloutBufferSamples(*(t.index_select(0, chosen) for t in tensors))
