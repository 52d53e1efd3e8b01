"""The layers of a model: input normalisation, and the actor and critic of mappo."""

from typing import Any, Final

import numpy as np
import numpy.typing as npt
import torch
from gymnasium import spaces
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor, create_mlp
from torch import nn

from posse_baselines.learned.network import LIMIT

_LEAST_DEVIATION: Final = 1e-3
_REMEMBERED: Final = 2_000_000.0
"""Largest count: from there on, new rows weigh more than old ones."""


class Normaliser(BaseFeaturesExtractor):
    """A layer: x → clip((x - mean) * scale, ±LIMIT), to mean 0 and deviation 1.

    Mean and scale are buffers of this layer inside the policy: rollouts and replay buffers store raw
    observations, a policy is never separated from its statistics, and the statistics change only
    between rollouts, so that a rollout is learned from with the statistics it was played with.
    """

    mean: torch.Tensor
    scale: torch.Tensor

    def __init__(self, observation_space: spaces.Box) -> None:
        size = observation_space.shape[0]
        super().__init__(observation_space, size)
        self.register_buffer("mean", torch.zeros(size))
        self.register_buffer("scale", torch.ones(size))

    def forward(self, observations: torch.Tensor) -> torch.Tensor:
        """Return the normalised observations, of the same shape."""
        return (observations - self.mean).mul_(self.scale).clamp_(-float(LIMIT), float(LIMIT))


class RunningStatistics(RunningMeanStd):
    """Running mean and variance of rows, (size,) each, in float64."""

    def __init__(self, size: int) -> None:
        super().__init__(epsilon=0.0, shape=(size,))

    def add(self, rows: npt.NDArray[np.float32]) -> None:
        """Add rows (..., size) to the statistics."""
        flat = rows.reshape(-1, rows.shape[-1])
        self.update_from_moments(flat.mean(axis=0, dtype=np.float64), flat.var(axis=0, dtype=np.float64), len(flat))
        self.count = min(self.count, _REMEMBERED)

    @property
    def scale(self) -> npt.NDArray[np.float64]:
        """1 / deviation, (size,); 0 for inputs that do not vary."""
        deviation = np.sqrt(self.var)
        return np.where(deviation < _LEAST_DEVIATION, 0.0, 1 / np.maximum(deviation, 1e-12))

    def apply(self, policy: nn.Module) -> None:
        """Write the statistics into every normaliser of a policy."""
        mean, scale = torch.as_tensor(self.mean), torch.as_tensor(self.scale)
        for module in policy.modules():
            if isinstance(module, Normaliser):
                module.mean.copy_(mean)
                module.scale.copy_(scale)

    def save(self) -> dict[str, Any]:
        """Return the statistics as tensors and plain values."""
        return {"count": self.count, "mean": torch.from_numpy(self.mean), "variance": torch.from_numpy(self.var)}

    def restore(self, saved: dict[str, Any]) -> None:
        """Set the statistics to those of :meth:`save`."""
        self.count, self.mean, self.var = saved["count"], saved["mean"].numpy(), saved["variance"].numpy()


class Front(nn.Module):
    """A layer that passes on the first numbers of its input."""

    def __init__(self, size: int) -> None:
        super().__init__()
        self.size = size

    def forward(self, inputs: torch.Tensor) -> torch.Tensor:
        """Return the first ``size`` columns."""
        return inputs[:, : self.size]


class CentralizedCriticPolicy(ActorCriticPolicy):
    """An actor that reads the first ``private_size`` numbers of an observation, and a critic that reads all of them.

    What is behind these is the state of the world. Further arguments are those of stable-baselines3's policy.
    """

    def __init__(self, *args: Any, private_size: int, **kwargs: Any) -> None:
        self.private_size = private_size
        super().__init__(*args, **kwargs)

    def _build_mlp_extractor(self) -> None:
        super()._build_mlp_extractor()
        hidden: Any = self.net_arch
        layers = create_mlp(self.private_size, 0, hidden, self.activation_fn)
        self.mlp_extractor.policy_net = nn.Sequential(Front(self.private_size), *layers)
        self.mlp_extractor.latent_dim_pi = hidden[-1] if hidden else self.private_size


ACTIVATIONS: Final[dict[str, type[nn.Module]]] = {"tanh": nn.Tanh, "relu": nn.ReLU}
