"""The default settings of a training, by preset, scenario and algorithm: the files in ``posse_training/defaults``."""

from __future__ import annotations

import tomllib
from importlib import resources
from typing import Any, Literal

from posse_training.train.algorithms import algorithm_of
from posse_training.train.settings import TrainSettings

Preset = Literal["nothing", "residual"]


def default_settings(
    scenario: str = "smart", algorithm: str = "ppo", *, side: str = "trackers", preset: Preset = "nothing"
) -> TrainSettings:
    """Return the default settings of a scenario.

    ``all.toml`` holds for every training, ``nothing.toml``, ``residual.toml`` and ``target.toml`` for a preset or a
    target, and the file of a scenario for its corrections. In each, the table ``all`` holds for every algorithm,
    ``on-policy`` and ``off-policy`` for those, and a table that is named after an algorithm for it alone.

    Args:
        scenario: A scenario's name, or several separated by commas.
        algorithm: One of the algorithms.
        side: What learns; a target learns from nothing, whatever the preset.
        preset: ``"nothing"``: learn from random weights, behind the safeguard; ``"residual"``: learn a correction of
            a scripted team, on policy and where the scenario has a file.

    Raises:
        SettingsError: An unknown algorithm, or an invalid default.
    """
    on_policy = algorithm_of(algorithm).on_policy
    values: dict[str, Any] = {"scenario": scenario, "algorithm": algorithm}
    folder = resources.files("posse_training") / "defaults"
    own = folder / ("mixture.toml" if "," in scenario else f"{scenario}.toml")
    if side == "target":  # its opponents are for the user to name
        values |= {"side": side, "team": "ddcs-distributed"}
        files = [folder / "target.toml"]
    elif preset == "residual" and on_policy and own.is_file():
        files = [folder / "residual.toml", own]
    else:
        files = [folder / "nothing.toml"]
    for file in (folder / "all.toml", *files):
        tables = tomllib.loads(file.read_text(encoding="utf-8"))
        for table in ("all", "on-policy" if on_policy else "off-policy", algorithm):
            values.update(tables.get(table, {}))
    return TrainSettings.from_dict(values)
