"""A run's folder: who writes to it, and how a training is kept so that it can go on.

A checkpoint is one safetensors file: numbers and JSON, nothing that could run. It is written beside
the last one, brought to the disk, and put in its place in one stroke, so that whenever the process
is killed there is a whole one.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import os
import random
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import IO, Any, Final

import numpy as np
import numpy.typing as npt
import torch
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save
from stable_baselines3.common.base_class import BaseAlgorithm

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

Arrays = dict[str, npt.NDArray[Any]]

SETTINGS: Final = "settings.json"
CHECKPOINT: Final = "checkpoint.safetensors"
LOCK: Final = "lock"
_FORMAT: Final = "posse-checkpoint-1"


class RunFolderError(RuntimeError):
    """A run folder that cannot be used; the message says why and what to do."""


class CheckpointError(RuntimeError):
    """A checkpoint that cannot be written or read."""


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a run folder: no other process may write to it meanwhile.

    The lock belongs to the process and ends with it, however it ends.

    Raises:
        RunFolderError: Another process holds it (the message names it), or it cannot be written to.
    """
    path = folder / LOCK
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = path.open("a+", encoding="utf-8")
    except OSError as error:
        raise RunFolderError(f"cannot write to run folder {folder}: {error}") from error
    with file:
        _hold(file, folder)
        file.seek(0)
        file.truncate()
        file.write(f"{os.getpid()}\n")
        file.flush()
        yield


def _hold(file: IO[str], folder: Path) -> None:
    if fcntl is None:
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        file.seek(0)
        holder = file.read().strip() or "another process"
        raise RunFolderError(
            f"run folder {folder} is in use by process {holder}: wait for it, stop it, or choose "
            "another --folder"
        ) from error


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file so that at any moment there is either the old one or the whole new one.

    Raises:
        OSError: The disk is full, say; the old file is as it was.
    """
    partial = path.with_name(f".{path.name}.partial")
    try:
        with partial.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    finally:
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)


def write_checkpoint(folder: Path, arrays: Arrays, state: Mapping[str, Any]) -> None:
    """Write a checkpoint: arrays by name, and plain values.

    Raises:
        CheckpointError: It could not be written. The one before is as it was.
    """
    text = json.dumps(state)
    packed = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
    metadata = {"format": _FORMAT, "state": text, "digest": _digest(packed, text)}
    path = folder / CHECKPOINT
    try:
        write_atomically(path, save(packed, metadata))
    except OSError as error:
        kept = "the one before is kept" if path.is_file() else "there is none before it"
        raise CheckpointError(
            f"cannot write checkpoint {path}: {error.strerror or error}; {kept}. Make room, then "
            f"go on with: posse train --resume {folder}"
        ) from error


def read_checkpoint(folder: Path) -> tuple[Arrays, dict[str, Any]]:
    """Return the arrays and the plain values of a folder's checkpoint.

    Raises:
        CheckpointError: There is none, or it is damaged.
    """
    path = folder / CHECKPOINT
    if not path.is_file():
        raise CheckpointError(
            f"{folder} has no {CHECKPOINT}: nothing was kept before it ended; start it anew"
        )
    try:
        with safe_open(path, framework="numpy") as file:
            arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
            metadata = file.metadata() or {}
        text = metadata["state"]
        if metadata["format"] != _FORMAT:
            raise CheckpointError(
                f"{path} is of format {metadata['format']!r}, this version reads {_FORMAT!r}"
            )
        whole = metadata["digest"] == _digest(arrays, text)
        state = json.loads(text)
    except (SafetensorError, OSError, KeyError, ValueError) as error:
        raise CheckpointError(
            f"checkpoint {path} is damaged: {error}. It cannot be gone on from; policies in the "
            "folder are files of their own"
        ) from error
    if not whole:
        raise CheckpointError(
            f"checkpoint {path} is damaged: its contents are not what was written. It cannot be "
            "gone on from; policies in the folder are files of their own"
        )
    return arrays, state


def _digest(arrays: Arrays, text: str) -> str:
    digest = hashlib.sha256(text.encode())
    for name in sorted(arrays):
        digest.update(f"{name} {arrays[name].dtype} {arrays[name].shape}".encode())
        digest.update(np.ascontiguousarray(arrays[name]).data)
    return digest.hexdigest()


# --- what a training consists of ------------------------------------------------------------------


def random_state() -> tuple[Arrays, dict[str, Any]]:
    """Return the state of every global random generator that learning draws from."""
    version, internal, gauss = random.getstate()
    name, keys, position, has_gauss, cached = np.random.get_state()  # noqa: NPY002 (SB3 draws from it)
    arrays = {"torch": torch.get_rng_state().numpy(), "numpy": np.asarray(keys)}
    state = {
        "python": [version, list(internal), gauss],
        "numpy": [str(name), int(position), int(has_gauss), float(cached)],
    }
    return arrays, state


def restore_random_state(arrays: Arrays, state: Mapping[str, Any]) -> None:
    """Set the generators to what :func:`random_state` returned."""
    version, internal, gauss = state["python"]
    random.setstate((version, tuple(internal), gauss))
    name, position, has_gauss, cached = state["numpy"]
    np.random.set_state((name, arrays["numpy"], position, has_gauss, cached))  # noqa: NPY002
    torch.set_rng_state(torch.from_numpy(arrays["torch"].copy()))


def flatten_tensors(value: Any, store: Callable[[npt.NDArray[Any]], str]) -> Any:
    """Return a nest of dictionaries and lists with each tensor replaced by its name in store."""
    if isinstance(value, torch.Tensor):
        return {"tensor": store(value.detach().cpu().numpy())}
    if isinstance(value, Mapping):
        return {"items": [[key, flatten_tensors(item, store)] for key, item in value.items()]}
    if isinstance(value, (list, tuple)):
        return {"list": [flatten_tensors(item, store) for item in value]}
    return {"value": value}


def unflatten_tensors(value: Any, arrays: Mapping[str, npt.NDArray[Any]]) -> Any:
    """Return the nest that :func:`flatten_tensors` was given."""
    if "tensor" in value:
        return torch.from_numpy(arrays[value["tensor"]].copy())
    if "items" in value:
        return {key: unflatten_tensors(item, arrays) for key, item in value["items"]}
    if "list" in value:
        return [unflatten_tensors(item, arrays) for item in value["list"]]
    return value["value"]


def model_state(model: BaseAlgorithm) -> tuple[Arrays, dict[str, Any]]:
    """Return all that a model needs to go on learning: networks, optimisers, counters, memory."""
    arrays: Arrays = {}

    def store(array: npt.NDArray[Any]) -> str:
        name = f"{len(arrays)}"
        arrays[name] = array
        return name

    names, tensors = model._get_torch_save_params()
    parts = {name: _find(model, name).state_dict() for name in names}
    state: dict[str, Any] = {
        "parts": flatten_tensors(parts, store),
        "tensors": flatten_tensors({name: _find(model, name) for name in tensors}, store),
        "num_timesteps": model.num_timesteps,
        "episode_num": model._episode_num,
        "n_updates": model._n_updates,
        "progress": model._current_progress_remaining,
        "episodes": list(model.ep_info_buffer or ()),
        "action_space": model.action_space.np_random.bit_generator.state,
    }
    arrays["last_obs"] = np.asarray(model._last_obs)
    arrays["last_starts"] = np.asarray(model._last_episode_starts)
    buffer = getattr(model, "replay_buffer", None)
    if buffer is not None:
        state["replay"] = [buffer.pos, buffer.full]
        for name in _REPLAY:
            arrays[f"replay.{name}"] = getattr(buffer, name)[: buffer.size()]
    return arrays, state


def restore_model(model: BaseAlgorithm, arrays: Arrays, state: Mapping[str, Any]) -> None:
    """Set a model that was made with the same settings to what :func:`model_state` returned."""
    for name, values in unflatten_tensors(state["parts"], arrays).items():
        _find(model, name).load_state_dict(values)
    for name, values in unflatten_tensors(state["tensors"], arrays).items():
        _find(model, name).data.copy_(values)
    model.num_timesteps = state["num_timesteps"]
    model._episode_num = state["episode_num"]
    model._n_updates = state["n_updates"]
    model._current_progress_remaining = state["progress"]
    model.ep_info_buffer = deque(state["episodes"], maxlen=model._stats_window_size)
    model.ep_success_buffer = deque(maxlen=model._stats_window_size)
    model.action_space.np_random.bit_generator.state = state["action_space"]
    model._last_obs = arrays["last_obs"].copy()
    model._last_episode_starts = arrays["last_starts"].copy()
    buffer = getattr(model, "replay_buffer", None)
    if buffer is not None:
        buffer.pos, buffer.full = state["replay"]
        for name in _REPLAY:
            getattr(buffer, name)[: buffer.size()] = arrays[f"replay.{name}"]


_REPLAY: Final = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


def _find(model: BaseAlgorithm, name: str) -> Any:
    """Return what a dotted name like ``"policy.optimizer"`` means."""
    return functools.reduce(getattr, name.split("."), model)
