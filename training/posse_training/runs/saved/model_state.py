"""The complete state of a model and of the random generators, as arrays and plain values."""

from __future__ import annotations

import functools
import random
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import torch
from stable_baselines3.common.base_class import BaseAlgorithm

from posse_training.runs.saved.checkpoint import Arrays

_REPLAY: Final = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")


def random_state() -> tuple[Arrays, dict[str, Any]]:
    """Return the state of every global random generator that training draws from."""
    version, internal, gauss = random.getstate()
    name, keys, position, has_gauss, cached = np.random.get_state()  # noqa: NPY002 (SB3 draws from it)
    arrays = {"torch": torch.get_rng_state().numpy(), "numpy": np.asarray(keys)}
    state = {
        "python": [version, list(internal), gauss],
        "numpy": [str(name), int(position), int(has_gauss), float(cached)],
    }
    return arrays, state


def restore_random_state(arrays: Arrays, state: Mapping[str, Any]) -> None:
    """Set the generators to the state of :func:`random_state`."""
    version, internal, gauss = state["python"]
    random.setstate((version, tuple(internal), gauss))
    name, position, has_gauss, cached = state["numpy"]
    np.random.set_state((name, arrays["numpy"], position, has_gauss, cached))  # noqa: NPY002
    torch.set_rng_state(torch.from_numpy(arrays["torch"].copy()))


def flatten_tensors(value: Any, store: Callable[[npt.NDArray[Any]], str]) -> Any:
    """Return nested dictionaries and lists with each tensor replaced by its name in store."""
    if isinstance(value, torch.Tensor):
        return {"tensor": store(value.detach().cpu().numpy())}
    if isinstance(value, Mapping):
        return {"items": [[key, flatten_tensors(item, store)] for key, item in value.items()]}
    if isinstance(value, (list, tuple)):
        return {"list": [flatten_tensors(item, store) for item in value]}
    return {"value": value}


def unflatten_tensors(value: Any, arrays: Mapping[str, npt.NDArray[Any]]) -> Any:
    """Return the argument of :func:`flatten_tensors`."""
    if "tensor" in value:
        return torch.from_numpy(arrays[value["tensor"]].copy())
    if "items" in value:
        return {key: unflatten_tensors(item, arrays) for key, item in value["items"]}
    if "list" in value:
        return [unflatten_tensors(item, arrays) for item in value["list"]]
    return value["value"]


def model_state(model: BaseAlgorithm) -> tuple[Arrays, dict[str, Any]]:
    """Return all that resuming needs: networks and their states, optimisers, counters, replay."""
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
        "successes": [bool(success) for success in model.ep_success_buffer or ()],
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
    """Set a model of the same settings to the state of :func:`model_state`."""
    names, tensors = model._get_torch_save_params()
    parts, loose = (unflatten_tensors(state[name], arrays) for name in ("parts", "tensors"))
    for name in names:
        _find(model, name).load_state_dict(parts[name])
    for name in tensors:
        _find(model, name).data.copy_(loose[name])
    model.num_timesteps = int(state["num_timesteps"])
    model._episode_num = int(state["episode_num"])
    model._n_updates = int(state["n_updates"])
    model._current_progress_remaining = float(state["progress"])
    model.ep_info_buffer = deque(state["episodes"], maxlen=model._stats_window_size)
    model.ep_success_buffer = deque(state["successes"], maxlen=model._stats_window_size)
    model.action_space.np_random.bit_generator.state = state["action_space"]
    model._last_obs = arrays["last_obs"].copy()
    model._last_episode_starts = arrays["last_starts"].copy()
    buffer = getattr(model, "replay_buffer", None)
    if buffer is not None:
        buffer.pos, buffer.full = state["replay"]
        for name in _REPLAY:
            getattr(buffer, name)[: buffer.size()] = arrays[f"replay.{name}"]


def _find(model: BaseAlgorithm, name: str) -> Any:
    """Return the part of a model with a dotted name like ``"policy.optimizer"``."""
    return functools.reduce(getattr, name.split("."), model)
