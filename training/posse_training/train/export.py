"""From a torch model to a policy that plays without torch, and its card."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from torch import nn

from posse_baselines.learned import Encoding, LearnedPolicy, Network
from posse_training.provenance import commit, software
from posse_training.train.algorithms import ALGORITHMS
from posse_training.train.networks import Normaliser
from posse_training.train.settings import TrainSettings


def export(model: BaseAlgorithm, settings: TrainSettings, encoding: Encoding, card: Mapping[str, Any]) -> LearnedPolicy:
    """Return a model as a policy that plays without torch.

    Its actions are the mode of the distribution, equal to the model's
    ``predict(..., deterministic=True)`` to rounding. A :class:`Normaliser` stands before its networks.
    """
    algorithm = ALGORITHMS[settings.algorithm]
    modules = [module for name in algorithm.actor for module in model.policy.get_submodule(name).modules()]
    layers = [module for module in modules if isinstance(module, nn.Linear)]
    inputs = layers[0].in_features  # behind them, a critic reads the state of the world
    normaliser = next(m for m in model.policy.modules() if isinstance(m, Normaliser))
    network = Network(
        mean=_numbers(normaliser.mean)[:inputs],
        scale=_numbers(normaliser.scale)[:inputs],
        weights=tuple(_numbers(layer.weight) for layer in layers),
        biases=tuple(_numbers(layer.bias) for layer in layers),
        activation=settings.activation,
        output=algorithm.bound,
    )
    return LearnedPolicy(network, encoding, card, safeguard=settings.safeguard)


def _numbers(tensor: torch.Tensor) -> npt.NDArray[np.float32]:
    return tensor.detach().cpu().numpy().astype(np.float32)


def make_card(settings: TrainSettings, *, steps: int, curve: list[dict[str, float]]) -> dict[str, Any]:
    """Return a policy's card: its training scenarios, settings, software and scores."""
    return {
        "name": settings.name,
        "side": settings.side,
        "scenarios": [scenario.to_dict() for scenario in settings.given],
        "trained_splits": ["train"],
        "chosen_on": "validation",
        "message_size": settings.given[0].message_size,
        "settings": settings.to_dict(),
        "seed": settings.seed,
        "steps": steps,
        "commit": commit(),
        "curve": curve,
        **{
            f"validation_{name}": curve[-1][name] if curve else None for name in ("safe_score", "score", "contact_free")
        },
        "software": software("numpy", "torch", "stable-baselines3"),
    }
