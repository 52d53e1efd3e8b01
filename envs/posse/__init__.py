"""posse: a team of unicycle robots finds, follows and holds formation on one mobile target."""

from typing import Any, Final

from posse import declarations
from posse.adapters.pettingzoo_env import env, parallel_env
from posse.adapters.robot import Command, Heard, Robot, TargetFix
from posse.declarations import (
    SENSORS,
    TARGET_MOTIONS,
    DeclarationError,
    Field,
    field,
    metric,
    reward_term,
    sensor,
    target_motion,
)
from posse.engine.batch import Batch, Snapshot
from posse.engine.opponent import PairedBatch, TargetPolicy, batch, batches
from posse.scenarios import Family, Scenario, ScenarioError, family, family_names, get_scenario, scenario_names
from posse.signals.generate import kernel_source
from posse.signals.layout import ObservationLayout

__version__ = "0.1.0"

METRICS: Final[tuple[metric, ...]] = declarations.METRICS.of()
"""Every built-in metric with ``name``, ``unit`` and ``meaning``, in the order in which they are reported."""
REWARD_TERMS: Final[tuple[reward_term, ...]] = declarations.REWARD_TERMS.of()
"""The built-in reward terms with ``name``, ``unit`` and ``meaning``, in the order in which they are reported."""


def observation_fields(scenario: str | Scenario = "constant", **overrides: Any) -> tuple[Field, ...]:
    """Return the fields of a scenario's observation, in order: name, size, unit, range, ..."""
    return ObservationLayout(get_scenario(scenario, **overrides)).fields


__all__ = [
    "METRICS",
    "REWARD_TERMS",
    "SENSORS",
    "TARGET_MOTIONS",
    "Batch",
    "Command",
    "DeclarationError",
    "Family",
    "Field",
    "Heard",
    "ObservationLayout",
    "PairedBatch",
    "Robot",
    "Scenario",
    "ScenarioError",
    "Snapshot",
    "TargetFix",
    "TargetPolicy",
    "batch",
    "batches",
    "env",
    "family",
    "family_names",
    "field",
    "get_scenario",
    "kernel_source",
    "metric",
    "observation_fields",
    "parallel_env",
    "reward_term",
    "scenario_names",
    "sensor",
    "target_motion",
]
