"""Default settings of a training run, by scenario and algorithm."""

from __future__ import annotations

import tomllib
from importlib import resources
from typing import Any

from posse_training.errors import SettingsError
from posse_training.runs.ranges import ALGORITHMS, ON_POLICY
from posse_training.runs.settings import TrainSettings


def default_settings(
    scenario: str = "smart", algorithm: str = "ppo", *, own: bool = True, side: str = "trackers"
) -> TrainSettings:
    """Return the default settings of a scenario.

    They are kept in ``posse_training/defaults``, one file for each scenario; ``all.toml`` holds
    for every scenario. In each, the table ``all`` holds for every algorithm, ``on-policy`` and
    ``off-policy`` for those, and a table that is named after an algorithm for it alone.

    Args:
        scenario: A scenario's name, or several separated by commas.
        algorithm: One of the algorithms.
        own: Whether to apply the scenario's own file.
        side: What learns; the defaults of a target are in ``target.toml``, instead of the
            scenario's own.

    Raises:
        SettingsError: An unknown algorithm, or an invalid default.
    """
    if algorithm not in ALGORITHMS:
        raise SettingsError(f"unknown algorithm {algorithm!r:.80}; algorithms are: {', '.join(ALGORITHMS)}")
    values: dict[str, Any] = {"scenario": scenario, "algorithm": algorithm}
    if side == "target":  # its opponents are for the user to name
        values |= {"side": side, "against": "ddcs-distributed"}
    folder = resources.files("posse_training") / "defaults"
    files = [folder / "all.toml"]
    if side == "target":
        files.append(folder / "target.toml")
    elif "," in scenario:
        files += [folder / "mixture.toml"] if own else []
    elif own and scenario in {file.name.removesuffix(".toml") for file in folder.iterdir()}:
        files.append(folder / f"{scenario}.toml")
    for file in files:
        tables = tomllib.loads(file.read_text(encoding="utf-8"))
        for table in ("all", "on-policy" if algorithm in ON_POLICY else "off-policy", algorithm):
            values.update(tables.get(table, {}))
    return TrainSettings.from_dict(values)
