"""What a run keeps on disk: its folder, its settings, its learning curve and its checkpoint.

A checkpoint is one file of tensors and plain values; reading one runs no code (``torch.load`` with ``weights_only``). A
new one replaces the last one atomically, so that a whole one exists whenever the process is killed.
"""

import io
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import torch
from stable_baselines3.common.base_class import BaseAlgorithm

from posse_baselines.files import write_atomically
from posse_training.errors import RunFolderError
from posse_training.train.networks import RunningStatistics
from posse_training.train.settings import Point

State = dict[str, Any]
"""Nested dictionaries of tensors and plain values."""

CHECKPOINT: Final = "checkpoint.pt"
_REPLAY: Final = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


@dataclass
class Progress:
    """How far a run is, as its checkpoint has it."""

    next_evaluation: int  # steps
    next_checkpoint: int = 0  # steps
    rollouts: int = 0
    seconds: float = 0.0
    curve: list[Point] = field(default_factory=list)


def write_checkpoint(folder: Path, state: State) -> None:
    """Write a checkpoint; the last one stays if that fails."""
    content = io.BytesIO()
    torch.save(state, content)
    write_atomically(folder / CHECKPOINT, content.getvalue())


def read_checkpoint(folder: Path) -> State:
    """Return the state of a folder's checkpoint, or raise RunFolderError."""
    path = folder / CHECKPOINT
    if not path.is_file():
        raise RunFolderError(f"{folder} has no {CHECKPOINT}, which every run but one of cmaes keeps: name another")
    try:
        if damaged := zipfile.ZipFile(path).testzip():  # torch does not compare the sums that it wrote
            raise ValueError(damaged)
        state: State = torch.load(path, weights_only=True)
    except Exception as error:  # whatever a damaged file makes torch raise
        raise RunFolderError(
            f"checkpoint {path} is damaged ({error!s:.100}). The run cannot be resumed from it; the policies in the "
            "folder are separate files"
        ) from error
    return state


def start_from(
    folder: Path, model: BaseAlgorithm, statistics: RunningStatistics, inputs: list[str], log_deviation: float
) -> None:
    """Give a model the networks of another run's checkpoint, and its statistics of inputs; optimisers start anew.

    So does exploration, with ``log_deviation``. RunFolderError as for :func:`read_checkpoint`, or if networks or inputs
    are others.
    """
    state = read_checkpoint(folder)
    try:
        if state.get("inputs", inputs) != inputs:
            raise ValueError("they read other fields")
        model.policy.load_state_dict(state["model"]["parts"]["policy"])
        statistics.restore(state["statistics"])
    except (KeyError, RuntimeError, TypeError, ValueError) as error:
        raise RunFolderError(
            f"the networks in {folder} do not fit this run: {error!s:.300}. Train on its scenario, with its hidden, "
            "activation, encoding and algorithm, or leave start out"
        ) from error
    spread = getattr(model.policy, "log_std", None)
    if spread is not None:
        with torch.no_grad():
            spread.fill_(log_deviation)


def tensors_of(arrays: Mapping[str, npt.NDArray[Any]]) -> dict[str, torch.Tensor]:
    """Return copies of arrays as tensors."""
    return {name: torch.from_numpy(np.array(array, order="C")) for name, array in arrays.items()}


def arrays_of(tensors: Mapping[str, torch.Tensor]) -> dict[str, npt.NDArray[Any]]:
    """Return tensors as arrays."""
    return {name: tensor.numpy() for name, tensor in tensors.items()}


def random_state() -> State:
    """Return the state of every global random generator that training draws from."""
    name, keys, *rest = np.random.get_state()  # noqa: NPY002 (SB3 draws from it)
    return {"numpy": (str(name), torch.from_numpy(np.asarray(keys)), *rest), "torch": torch.get_rng_state()}


def restore_random_state(state: State) -> None:
    """Set the generators to the state of :func:`random_state`."""
    name, keys, *rest = state["numpy"]
    np.random.set_state((name, keys.numpy(), *rest))  # noqa: NPY002
    torch.set_rng_state(state["torch"])


def model_state(model: BaseAlgorithm) -> State:
    """Return all that resuming needs: networks and their states, optimisers, counters, replay."""
    arrays = {"obs": np.asarray(model._last_obs), "starts": np.asarray(model._last_episode_starts)}
    _, tensors = model._get_torch_save_params()
    state: State = {
        "parts": model.get_parameters(),
        "tensors": {name: getattr(model, name).detach() for name in tensors},
        "num_timesteps": model.num_timesteps,
        "n_updates": model._n_updates,
        "action_space": model.action_space.np_random.bit_generator.state,
        "last": tensors_of(arrays),
    }
    buffer = getattr(model, "replay_buffer", None)
    if buffer is not None:
        parts = tensors_of({name: getattr(buffer, name)[: buffer.size()] for name in _REPLAY})
        state["replay"] = {"position": buffer.pos, "full": buffer.full, "parts": parts}
    return state


def restore_model(model: BaseAlgorithm, state: State) -> None:
    """Set a model of the same settings to the state of :func:`model_state`."""
    model.set_parameters(state["parts"])
    for name, tensor in state["tensors"].items():
        getattr(model, name).data.copy_(tensor)
    model.num_timesteps = state["num_timesteps"]
    model._n_updates = state["n_updates"]
    model.action_space.np_random.bit_generator.state = state["action_space"]
    last = arrays_of(state["last"])
    model._last_obs, model._last_episode_starts = last["obs"], last["starts"]
    buffer = getattr(model, "replay_buffer", None)
    if buffer is not None:
        buffer.pos, buffer.full = state["replay"]["position"], state["replay"]["full"]
        for name, part in arrays_of(state["replay"]["parts"]).items():
            getattr(buffer, name)[: buffer.size()] = part
