"""The valid range of each training setting."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any, Final

from posse_training.errors import SettingsError

ON_POLICY: Final = ("ppo", "mappo")
ALGORITHMS: Final = (*ON_POLICY, "sac", "td3")
_WIDEST: Final = 8192
_CHOICES: Final = {
    "algorithm": ALGORITHMS,
    "side": ("trackers", "target"),
    "encoding": ("plain", "slots", "belief"),
    "correction": ("motion", "velocity"),
    "activation": ("tanh", "relu"),
}
_INTEGERS: Final = {
    "steps": (1, 10**12),
    "seed": (0, 2**32 - 1),
    "num_worlds": (1, 10**6),
    "message_size": (0, 64),
    "minibatch": (2, 10**9),
    "rollout": (1, 10**6),
    "epochs": (1, 1000),
    "replay": (1, 10**9),
    "learning_starts": (0, 10**12),
    "gradients": (1, 10**4),
    "imitate_rounds": (1, 1000),
    "evaluate_every": (1, 10**15),
    "evaluate_worlds": (1, 10**6),
    "checkpoint_every": (1, 10**15),
    "threads": (1, 1024),
}
_NUMBERS: Final = {
    "learning_rate": (0, 10),
    "final_learning_rate": (0, 10),
    "discount": (0, 1),
    "gae_lambda": (0, 1),
    "clip": (0, 100),
    "entropy": (0, 1000),
    "value_weight": (0, 1000),
    "log_deviation": (-20, 5),
}
_LEAST_BOUND: Final = 0.001  # of the share of episodes with contact
_TEXTS: Final = ("scenario", "against", "start", "imitate", "advise", "beside", "wandb")
_LONGEST: Final = 4096
_LAYERS: Final = 16


def check_ranges(settings: Any) -> None:
    """Raise if a setting is of a wrong type or out of its range.

    Raises:
        SettingsError: The message names the setting, its value and what is allowed.
    """
    for name, choices in _CHOICES.items():
        value = getattr(settings, name)
        if value not in choices:
            _fail(name, value, f"unknown; {name}s are: {', '.join(choices)}")
    for name, (low, high) in _INTEGERS.items():
        _check_integer(name, getattr(settings, name), low, high)
    if settings.num_neighbours is not None:
        _check_integer("num_neighbours", settings.num_neighbours, 0, 4096)
    for name, (low, high) in _NUMBERS.items():
        _check_number(name, getattr(settings, name), low, high)
    if settings.final_log_deviation is not None:
        _check_number("final_log_deviation", settings.final_log_deviation, -20, 5)
    if settings.contact_bound is not None:
        _check_number("contact_bound", settings.contact_bound, _LEAST_BOUND, 1)
    for name in _TEXTS:
        value = getattr(settings, name)
        if value is None and name != "scenario":
            continue
        if not isinstance(value, str) or not 1 <= len(value) <= _LONGEST or "\0" in value:
            _fail(name, value, f"it must be a text of 1 to {_LONGEST} characters")
    _check_sequence("hidden", settings.hidden, range(1, _LAYERS + 1), _WIDEST)
    _check_sequence("team_sizes", settings.team_sizes, range(101), 4096)
    if settings.folder is not None and not isinstance(settings.folder, Path):
        _fail("folder", settings.folder, "it must be a path")
    for name in ("overrides", "reward_weights"):
        if not isinstance(getattr(settings, name), dict):
            _fail(name, getattr(settings, name), "it must map names to values")


def _check_sequence(name: str, value: Any, lengths: Collection[int], highest: int) -> None:
    if not isinstance(value, tuple) or len(value) not in lengths:
        _fail(name, value, f"it must name {min(lengths)} to {max(lengths)} numbers")
    for number in value:
        _check_integer(name, number, 1, highest)


def _check_number(name: str, value: Any, low: float, high: float) -> None:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        _fail(name, value, "it must be a number")
    if not low <= value <= high:
        _fail(name, value, f"it must lie in [{low:g}, {high:g}]")


def _check_integer(name: str, value: Any, low: int, high: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int):
        _fail(name, value, "it must be a whole number")
    if value < low:
        _fail(name, value, f"it must be at least {low}")
    if value > high:
        _fail(name, value, f"it must be at most {high}")


def _fail(name: str, value: Any, why: str) -> None:
    shown = repr(value)
    short = shown if len(shown) <= 80 else f"{shown[:60]}... ({len(shown):,} characters)"
    raise SettingsError(f"{name}={short} is invalid: {why}")
