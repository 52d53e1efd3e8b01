"""Begins a run with the networks of another one."""

from __future__ import annotations

from pathlib import Path

import torch
from stable_baselines3.common.base_class import BaseAlgorithm

from posse_training.errors import CheckpointError
from posse_training.runs.saved.checkpoint import read_checkpoint
from posse_training.runs.saved.model_state import unflatten_tensors
from posse_training.sb3.normalisation import RunningStatistics


def start_from(folder: Path, model: BaseAlgorithm, statistics: RunningStatistics, log_deviation: float) -> None:
    """Take networks and input statistics from a run's checkpoint; optimisers start anew.

    Args:
        folder: The other run's folder.
        model: Takes the networks.
        statistics: Takes the input statistics.
        log_deviation: Exploration starts anew with it.

    Raises:
        CheckpointError: There is no checkpoint, it is damaged, or of other networks or inputs.
    """
    arrays, state = read_checkpoint(folder)
    model_arrays = {name.removeprefix("model/"): array for name, array in arrays.items() if name.startswith("model/")}
    try:
        parts = unflatten_tensors(state["model"]["parts"], model_arrays)
        model.policy.load_state_dict(parts["policy"])
        statistics.restore({name: arrays[f"statistics/{name}"] for name in ("count", "mean", "variance")})
    except (KeyError, RuntimeError, TypeError, ValueError) as error:
        raise CheckpointError(
            f"the networks in {folder} do not fit this run: {error!s:.300}. Train with its hidden, "
            "activation, encoding and algorithm, or leave start out"
        ) from error
    spread = getattr(model.policy, "log_std", None)
    if spread is not None:
        with torch.no_grad():
            spread.fill_(log_deviation)
