"""Trainings of about a second, and their results."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
import torch
from rich.console import Console
from safetensors.torch import load_file

from posse_training.train import TrainSettings, read_settings
from posse_training.train.checkpoint import read_checkpoint
from posse_training.train.train import train

HORIZON = 40
SHORT: dict[str, Any] = {"horizon": HORIZON, "settle_time": 1.0, "range_noise": 0.02, "bearing_noise": 0.02}


def small(folder: Path, algorithm: str = "ppo", **changes: Any) -> TrainSettings:
    """Settings of a training that takes about a second."""
    settings = TrainSettings(
        scenario="constant",
        algorithm=algorithm,
        steps=1280,
        seed=3,
        folder=folder,
        num_worlds=4,
        team_sizes=(2,),
        overrides=SHORT,
        hidden=(16, 16),
        minibatch=64,
        rollout=20,
        epochs=2,
        replay=2000,
        learning_starts=80,
        gradients=1,
        evaluate_every=640,
        evaluate_worlds=3,
        beside=None,
        checkpoint_every=320,
        tensorboard=False,
    )
    return replace(settings, **changes)


def quiet() -> Console:
    return Console(file=StringIO())


def resume(folder: Path, **changes: Any) -> None:
    """Train with the settings of a run folder."""
    train(replace(read_settings(folder / "settings.json"), folder=folder, **changes), console=quiet())


def numbers(folder: Path) -> dict[str, Any]:
    """All results of a finished training by name, without its duration: arrays as bytes, and plain values."""
    state = {"checkpoint": read_checkpoint(folder), "last": load_file(folder / "last.safetensors")}
    return {name: value for name, value in _flat(state) if not name.endswith("/seconds")}


def _flat(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    if isinstance(value, (dict, list, tuple)):
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, item in items:
            yield from _flat(item, f"{name}/{key}")
    else:
        yield name, value.numpy().tobytes() if isinstance(value, torch.Tensor) else value


def steps_saved(folder: Path) -> int:
    """The steps that a run's checkpoint was written after."""
    return int(read_checkpoint(folder)["model"]["num_timesteps"])


class Killed(BaseException):
    """Ends a run as a signal does."""


@contextmanager
def killed_at(owner: Any, name: str, call: int) -> Iterator[None]:
    """Have a function end what calls it at one of its calls, and expect that."""
    original, calls = getattr(owner, name), [0]

    def dying(*arguments: Any, **named: Any) -> Any:
        calls[0] += 1
        if calls[0] == call:
            raise Killed
        return original(*arguments, **named)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(owner, name, dying)
        with pytest.raises(Killed):
            yield


GUARDED: dict[str, Any] = {"scenario": "smart", "safeguard": True, "end_on_contact": True, "overrides": SHORT}
"""From nothing, behind the safeguard."""
TARGET: dict[str, Any] = {
    "scenario": "smart",
    "side": "target",
    "encoding": "plain",
    "team": "ddcs-distributed,idle",
    "team_sizes": (),
    "steps": 640,
    "evaluate_every": 320,
    "checkpoint_every": 160,
    "overrides": {**SHORT, "num_trackers": 3},
    "reward_weights": {"team": -1.0, "contact": -0.5},
}
"""Of a target against two teams."""
AGAINST: dict[str, Any] = {
    "scenario": "smart",
    "team": None,
    "target": "smart,evader",
    "team_sizes": (),
    "overrides": {**SHORT, "num_trackers": 3},
}
"""Of a team against two targets, of which one is learned."""
