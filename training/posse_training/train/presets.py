"""The default settings of a training, by preset, scenario and algorithm: ``defaults.toml`` beside this file."""

import tomllib
from importlib import resources
from typing import Any, Literal

from posse_training.errors import SettingsError
from posse_training.train.algorithms import EVOLUTION, algorithm_of
from posse_training.train.settings import TrainSettings

Preset = Literal["nothing", "residual"]


def default_settings(
    scenario: str = "smart", algorithm: str | None = None, *, side: str = "trackers", preset: Preset = "nothing"
) -> TrainSettings:
    """Return the default settings of a scenario.

    Args:
        scenario: A scenario's name, or several separated by commas.
        algorithm: One of the algorithms; default: ppo; cmaes of the preset ``"residual"``, and for teams on scenarios
            where it learns more.
        side: What learns; a target learns from nothing, whatever the preset.
        preset: ``"nothing"``: learn from random weights, or zero, behind the safeguard; ``"residual"``: learn a
            correction of a scripted team, which cmaes does and no other algorithm.

    Raises:
        SettingsError: An unknown algorithm, or a correction by another than cmaes.
    """
    file = resources.files("posse_training.train") / "defaults.toml"
    defaults = tomllib.loads(file.read_text(encoding="utf-8"))
    evolves = side == "trackers" and {name.strip() for name in scenario.split(",")} <= set(defaults["evolved"])
    algorithm = algorithm or (EVOLUTION if preset == "residual" or evolves else "ppo")
    if preset == "residual" and algorithm != EVOLUTION:
        raise SettingsError(f"preset='residual' goes with cmaes, not {algorithm}: leave one of them out")
    values: dict[str, Any] = {"scenario": scenario, "algorithm": algorithm}
    if side == "target":  # its opponents are for the user to name
        values |= {"side": side, "team": "ddcs-distributed"}
    tables = ["all", algorithm]
    if algorithm != EVOLUTION:
        tables.insert(1, "on-policy" if algorithm_of(algorithm).on_policy else "off-policy")
    for name in ("every", "target" if side == "target" else preset):
        for table in tables:
            values.update(defaults[name].get(table, {}))
    return TrainSettings.from_dict(values)
