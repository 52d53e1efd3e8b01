"""The default settings of a training, by preset, scenario and algorithm: ``defaults.toml`` beside this file."""

from __future__ import annotations

import tomllib
from importlib import resources
from typing import Any, Literal

from posse_training.errors import SettingsError
from posse_training.train.algorithms import EVOLUTION, algorithm_of
from posse_training.train.settings import TrainSettings

Preset = Literal["nothing", "residual"]


def default_settings(
    scenario: str = "smart", algorithm: str = "ppo", *, side: str = "trackers", preset: Preset = "nothing"
) -> TrainSettings:
    """Return the default settings of a scenario.

    Args:
        scenario: A scenario's name, or several separated by commas.
        algorithm: One of the algorithms.
        side: What learns; a target learns from nothing, whatever the preset.
        preset: ``"nothing"``: learn from random weights, behind the safeguard; ``"residual"``: learn a correction of
            a scripted team, on policy; cmaes always learns that.

    Raises:
        SettingsError: An unknown algorithm, or a correction off policy.
    """
    tables: tuple[str, ...] = "all", algorithm
    if algorithm != EVOLUTION:
        tables = "all", "on-policy" if algorithm_of(algorithm).on_policy else "off-policy", algorithm, scenario
    values: dict[str, Any] = {"scenario": scenario, "algorithm": algorithm}
    learns: str = "residual" if algorithm == EVOLUTION else preset
    if side == "target":  # its opponents are for the user to name
        values |= {"side": side, "team": "ddcs-distributed"}
        learns = "target"
    elif preset == "residual" and "off-policy" in tables:
        raise SettingsError(f"preset='residual' goes with ppo or mappo, not {algorithm}: use the preset nothing")
    file = resources.files("posse_training.train") / "defaults.toml"
    defaults = tomllib.loads(file.read_text(encoding="utf-8"))
    for name in ("every", learns):
        for table in tables:
            values.update(defaults[name].get(table, {}))
    return TrainSettings.from_dict(values)
