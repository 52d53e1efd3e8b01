"""MAPPO: the policy reads a tracker's observation, the value function the state of the world.

The state is appended to the observation (:class:`posse_training.sb3.vec_env.TeamVecEnv`,
``see_state``); the policy network does not read that part. The rest is stable-baselines3's PPO.
"""

from __future__ import annotations

from typing import Any

import torch
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import create_mlp
from torch import nn


class SplitNetworks(nn.Module):
    """A policy network on the first numbers of the input, a value network on all of them."""

    def __init__(self, size: int, private_size: int, hidden: list[int], activation: type[nn.Module]) -> None:
        super().__init__()
        self.private_size = private_size
        self.latent_dim_pi = self.latent_dim_vf = hidden[-1]
        self.policy_net = nn.Sequential(*create_mlp(private_size, 0, hidden, activation))
        self.value_net = nn.Sequential(*create_mlp(size, 0, hidden, activation))

    def forward(self, features: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the latent vectors of policy and value."""
        return self.forward_actor(features), self.forward_critic(features)

    def forward_actor(self, features: torch.Tensor) -> torch.Tensor:
        """Return the policy's latent vector, a function of the tracker's own numbers only."""
        latent: torch.Tensor = self.policy_net(features[:, : self.private_size])
        return latent

    def forward_critic(self, features: torch.Tensor) -> torch.Tensor:
        """Return the value's latent vector."""
        latent: torch.Tensor = self.value_net(features)
        return latent


class CentralizedCriticPolicy(ActorCriticPolicy):
    """An actor and a critic; only the critic reads the state of the world.

    Args:
        *args: Arguments of stable-baselines3's actor-critic policy.
        private_size: Numbers at the front of an observation that the actor reads.
        hidden: Widths of the hidden layers of both networks.
        **kwargs: Arguments of stable-baselines3's actor-critic policy.
    """

    def __init__(self, *args: Any, private_size: int, hidden: tuple[int, ...] = (64, 64), **kwargs: Any) -> None:
        self.private_size = private_size
        self.hidden = list(hidden)
        super().__init__(*args, **kwargs)

    def _build_mlp_extractor(self) -> None:
        self.mlp_extractor = SplitNetworks(  # type: ignore[assignment]
            self.features_dim, self.private_size, self.hidden, self.activation_fn
        )
