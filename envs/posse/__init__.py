"""posse: a team of unicycle robots finds, follows and holds formation on one mobile target."""

from __future__ import annotations

from typing import Any, Final

from posse import declarations
from posse.adapters.pettingzoo_env import env, parallel_env
from posse.adapters.registration import register as _register
from posse.adapters.robot import Command, Heard, Robot, TargetFix
from posse.declarations import (
    SENSORS,
    TARGET_MOTIONS,
    Field,
    Memory,
    Metric,
    RewardTerm,
    Sensor,
    TargetMotion,
    field,
    metric,
    reward_term,
    sensor,
    target_motion,
)
from posse.engine.batch import Batch, Snapshot
from posse.engine.opponent import PairedBatch, TargetPolicy, batch_with
from posse.registry import DeclarationError
from posse.scenarios import Family, Scenario, ScenarioError, family, family_names, get_scenario, scenario_names
from posse.scenarios.family import scenario_or_family
from posse.signals.generate import declarations_for, source_of
from posse.signals.layout import ObservationLayout

__version__ = "0.1.0"

METRICS: Final[tuple[Metric, ...]] = declarations.METRICS.built_in()
"""Every built-in metric, in the order in which they are reported."""
REWARD_TERMS: Final[tuple[RewardTerm, ...]] = declarations.REWARD_TERMS.built_in()
"""The built-in reward terms, in the order in which they are reported."""

_register()


def batch(
    scenario: str | Scenario = "constant",
    num_worlds: int = 1,
    *,
    seed: int = 0,
    split: str = "train",
    first_world: int = 0,
    autoreset: str = "next_step",
    num_threads: int | None = None,
    clip_actions: bool = False,
    target_policy: TargetPolicy | None = None,
    team_policy: TargetPolicy | None = None,
    **overrides: Any,
) -> Batch:
    """Return a batch of worlds, on which all environments are built; see :class:`Batch`.

    With ``target_policy`` that policy moves the target of every world; observations, actions and
    rewards are those of the trackers. With ``team_policy`` a policy moves the trackers, and they
    are those of the target, one row and actions of two numbers. Both return a :class:`PairedBatch`.
    """
    return batch_with(
        get_scenario(scenario, **overrides),
        num_worlds,
        target_policy,
        team_policy,
        seed=seed,
        split=split,
        first_world=first_world,
        autoreset=autoreset,
        num_threads=num_threads,
        clip_actions=clip_actions,
    )


def batches(
    scenario: str | Scenario | Family,
    num_worlds: int,
    *,
    scenarios: int = 16,
    seed: int = 0,
    split: str = "train",
    first_world: int = 0,
    **settings: Any,
) -> list[Batch]:
    """Return batches that hold so many worlds together: of a family one for each of ``scenarios`` drawn scenarios.

    A world depends on seed, split and its number alone; so does scenario k on seed, split and k. The other settings
    are those of :func:`batch`.
    """
    given = scenario_or_family(scenario)
    drawn = [given.draw(k, seed, split) for k in range(scenarios)] if isinstance(given, Family) else [given]
    if num_worlds < len(drawn):
        raise ScenarioError(
            f"num_worlds={num_worlds} is refused: it must be at least {len(drawn)}, one for each scenario"
        )
    ends = [num_worlds * k // len(drawn) for k in range(len(drawn) + 1)]
    return [
        batch(one, end - start, seed=seed, split=split, first_world=first_world + start, **settings)
        for one, start, end in zip(drawn, ends[:-1], ends[1:], strict=True)
    ]


def observation_fields(scenario: str | Scenario = "constant", **overrides: Any) -> tuple[Field, ...]:
    """Return the fields of a scenario's observation, in order: name, size, unit, range, ..."""
    return ObservationLayout(get_scenario(scenario, **overrides)).fields


def kernel_source(scenario: str | Scenario = "constant", **overrides: Any) -> str:
    """Return the source text of what the kernel of a scenario calls for its declarations.

    It has one function each for the own observation fields, those of a team-mate, the rewards, the target's motion,
    the sensor and the sums of the metrics.
    """
    return source_of(declarations_for(get_scenario(scenario, **overrides)))


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
    "Memory",
    "Metric",
    "ObservationLayout",
    "PairedBatch",
    "RewardTerm",
    "Robot",
    "Scenario",
    "ScenarioError",
    "Sensor",
    "Snapshot",
    "TargetFix",
    "TargetMotion",
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
