"""PPO with a recurrent policy: sb3-contrib's, with a faster rollout buffer.

Gradients are taken through sequences that begin where a rollout or an episode begins. In
sb3-contrib, sequences are cut where minibatches happen to end, and the network loops over the steps
of a minibatch in which any episode begins. Here a minibatch holds all sequences of some slots,
drawn at random, whose first state is zero already where an episode begins, so that one call of
torch's LSTM computes all steps.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from sb3_contrib import RecurrentPPO
from sb3_contrib.common.recurrent.buffers import RecurrentRolloutBuffer
from sb3_contrib.common.recurrent.type_aliases import RecurrentRolloutBufferSamples, RNNStates
from stable_baselines3.common.buffers import RolloutBuffer

from posse_training.sb3.speedups import FlatRolloutBuffer

_ROWS = ("observations", "actions")
_NUMBERS = ("values", "log_probs", "advantages", "returns")


class SequenceBuffer(FlatRolloutBuffer, RecurrentRolloutBuffer):
    """A rollout buffer whose minibatches are sequences of whole slots, in random order.

    Of the network's states it keeps those before the first step: all other sequences begin with an
    episode, at zero. The order is drawn from numpy's global generator; each slot occurs once a
    pass.
    """

    def reset(self) -> None:
        """Forget the rollout."""
        RolloutBuffer.reset(self)
        self.first_states: RNNStates | None = None

    def add(  # type: ignore[override]
        self, *args: Any, lstm_states: RNNStates, **kwargs: Any
    ) -> None:
        """Store one step of every slot, and the states before the first one."""
        if self.pos == 0:
            self.first_states = lstm_states
        super().add(*args, **kwargs)

    def get(  # type: ignore[override]
        self, batch_size: int | None = None
    ) -> Generator[RecurrentRolloutBufferSamples, None, None]:
        """Yield minibatches of ``batch_size`` steps, about; default: all at once.

        Raises:
            RuntimeError: The rollout is not complete.
        """
        if not self.full or self.first_states is None:
            raise RuntimeError("the rollout must be complete before minibatches are drawn from it")
        slots = max(1, (batch_size or self.buffer_size * self.n_envs) // self.buffer_size)
        order = np.random.permutation(self.n_envs)  # noqa: NPY002 (as SB3 does)
        for first in range(0, self.n_envs, slots):
            yield self._sequences(order[first : first + slots], self.first_states)

    def _sequences(self, slots: npt.NDArray[np.int64], states: RNNStates) -> RecurrentRolloutBufferSamples:
        """Return the sequences of some slots, padded to equal length: (sequences x steps, ...)."""
        begins = self.episode_starts[:, slots] > 0
        goes_on = ~begins[0]
        begins[0] = True
        column, start = np.nonzero(begins.T)  # by slot, then by time
        last = np.append(column[1:] != column[:-1], True)
        end = np.where(last, self.buffer_size, np.append(start[1:], 0))
        length = end - start
        steps = np.arange(length.max())
        there = torch.from_numpy(steps < length[:, None]).reshape(-1)
        rows = np.minimum(start[:, None] + steps, self.buffer_size - 1) * self.n_envs
        chosen = torch.from_numpy(rows + slots[column][:, None]).reshape(-1)
        parts = {}
        for name in _ROWS:
            array = getattr(self, name)
            parts[name] = torch.from_numpy(array.reshape(len(array) * self.n_envs, -1))[chosen]
        for name in _NUMBERS:
            number = torch.from_numpy(getattr(self, name).reshape(-1))[chosen]
            parts[name] = torch.where(there, number, 0.0)
        kept = torch.from_numpy((start == 0) & goes_on[column]).view(1, -1, 1)
        slot = torch.from_numpy(slots[column])

        def at_start(state: torch.Tensor) -> torch.Tensor:
            return torch.where(kept, state[:, slot], 0.0)

        return RecurrentRolloutBufferSamples(
            observations=parts["observations"],
            actions=parts["actions"],
            old_values=parts["values"],
            old_log_prob=parts["log_probs"],
            advantages=parts["advantages"],
            returns=parts["returns"],
            lstm_states=RNNStates(
                (at_start(states.pi[0]), at_start(states.pi[1])), (at_start(states.vf[0]), at_start(states.vf[1]))
            ),
            episode_starts=torch.zeros(len(chosen)),
            mask=there.float(),
        )


class SequencePPO(RecurrentPPO):
    """sb3-contrib's PPO with a :class:`SequenceBuffer`."""

    def _setup_model(self) -> None:
        super()._setup_model()
        usual: Any = self.rollout_buffer
        self.rollout_buffer = SequenceBuffer(
            self.n_steps,
            self.observation_space,
            self.action_space,
            usual.hidden_state_shape,
            self.device,
            gamma=self.gamma,
            gae_lambda=self.gae_lambda,
            n_envs=self.n_envs,
        )
