"""The actor and the critic of PPO on TorchRL, shared by all trackers."""

from __future__ import annotations

from typing import Final

import torch
from tensordict.nn import AddStateIndependentNormalScale, TensorDictModule
from torch import nn
from torchrl.modules import IndependentNormal, ProbabilisticActor, ValueOperator

from posse_training.torchrl.env import TRACKERS, PosseEnv

OBSERVATION: Final = (TRACKERS, "observation")
ACTION: Final = (TRACKERS, "action")
DRAWN: Final = (TRACKERS, "drawn")
"""The sample of the policy's normal distribution; the action is it, clipped to [-1, 1]."""
REWARD: Final = (TRACKERS, "reward")
REWARD_NEXT: Final = ("next", *REWARD)
LOG_PROBABILITY: Final = (TRACKERS, "action_log_prob")
VALUE: Final = (TRACKERS, "state_value")
LOSSES: Final = ("loss_objective", "loss_critic", "loss_entropy")


class RunningScale(nn.Module):
    """Normalises observations (..., F) to mean 0 and deviation 1 by running statistics.

    The statistics are buffers, so that a policy is never separated from them.
    """

    mean: torch.Tensor
    variance: torch.Tensor
    count: torch.Tensor

    def __init__(self, size: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(size))
        self.register_buffer("variance", torch.ones(size))
        self.register_buffer("count", torch.zeros(()))

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Return the normalised observations, within ±10."""
        return ((observations - self.mean) / (self.variance + 1e-8).sqrt()).clamp(-10.0, 10.0)

    @torch.no_grad()
    def update(self, observations: torch.Tensor) -> None:
        """Add observations to the statistics (pairwise form of Chan, Golub and LeVeque)."""
        flat = observations.reshape(-1, observations.shape[-1])
        new, total = len(flat), self.count + len(flat)
        apart = flat.mean(0) - self.mean
        squares = self.variance * self.count + flat.var(0, correction=0) * new
        self.variance.copy_((squares + apart**2 * self.count * new / total) / total)
        self.mean.add_(apart * new / total)
        self.count.copy_(total)


class Agent(nn.Module):
    """The policy and the critic of every tracker.

    Attributes:
        actor: Adds samples and their log-probabilities to a tensordict.
        critic: Adds values.
        scale: Input normalisation of both.
    """

    def __init__(self, env: PosseEnv, hidden: tuple[int, ...]) -> None:
        super().__init__()
        size = env.observation_spec[OBSERVATION].shape[-1]
        width = env.full_action_spec[ACTION].shape[-1]
        self.scale = RunningScale(size)
        policy = nn.Sequential(self.scale, *_layers(size, hidden, width, 0.01), AddStateIndependentNormalScale(width))
        value = nn.Sequential(self.scale, *_layers(size, hidden, 1, 1.0))
        parameters = [(TRACKERS, "loc"), (TRACKERS, "scale")]
        self.actor = ProbabilisticActor(
            TensorDictModule(policy, [OBSERVATION], parameters),
            in_keys=parameters,
            out_keys=[DRAWN],
            distribution_class=IndependentNormal,
            return_log_prob=True,
            log_prob_key=LOG_PROBABILITY,
        )
        self.critic = ValueOperator(value, in_keys=[OBSERVATION], out_keys=[VALUE])


def _layers(size: int, hidden: tuple[int, ...], out: int, gain: float) -> list[nn.Module]:
    """Return a perceptron's layers; ``gain`` is that of the last one's initial weights."""
    layers: list[nn.Module] = []
    for width in hidden:
        layers += [_linear(size, width, 2**0.5), nn.Tanh()]
        size = width
    return [*layers, _linear(size, out, gain)]


def _linear(size: int, width: int, gain: float) -> nn.Linear:
    layer = nn.Linear(size, width)
    nn.init.orthogonal_(layer.weight, gain)
    nn.init.zeros_(layer.bias)
    return layer
