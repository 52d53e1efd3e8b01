"""Description of a recorded world for the page: scenario, settings, positions."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Final

import numpy.typing as npt

import posse
from posse import REWARD_TERMS, Field, Scenario, ScenarioError, get_scenario
from posse_baselines import Trajectory
from posse_baselines.ddcs import TASKS
from posse_training.provenance import commit

PLACES: Final = ("world_seed", "world_index", "world_episode", "obstacle_x", "obstacle_y", "obstacle_radius")
"""Names of the state arrays that say which world was played."""
_OWN: Final = ("heading", "position", "speed", "turn_rate", "touching", "working")


def describe_world(
    arrays: Mapping[str, npt.NDArray[Any]], trajectory: Trajectory, observations: bool
) -> dict[str, Any]:
    """Return the common data of all players of a world, as plain JSON with infinite numbers.

    Args:
        arrays: Of the world, by name.
        trajectory: That they are from.
        observations: Whether to describe all fields of an observation, or only the sonar.
    """
    scenario = trajectory.scenario
    start = {name: arrays[name][0] for name in PLACES}
    weights = {name: weight for name, weight in dict(scenario.reward_weights).items() if weight}
    return {
        "posse": posse.__version__,
        "commit": commit(),
        "scenario": scenario.name,
        "version": scenario.version,
        "settings": _settings(scenario),
        "changed": changed_settings(scenario),
        "seed": int(start["world_seed"]),
        "split": trajectory.split,
        "world": int(start["world_index"]),
        "episode": int(start["world_episode"]),
        "agents": scenario.num_agents,
        "slots": [[float(x), float(y)] for x, y in scenario.slot_offsets],
        "obstacles": [
            [float(start[f"obstacle_{name}"][k]) for name in ("x", "y", "radius")]
            for k in range(scenario.num_obstacles)
        ],
        "tasks": list(TASKS),
        "weights": weights,
        "terms": [
            {"name": term.name, "unit": term.unit, "meaning": term.meaning}
            for term in REWARD_TERMS
            if term.name in weights
        ],
        "fields": [_described(field) for field in trajectory.layout.fields if observations or field.name == "sonar"],
        "metrics": [{"name": metric.name, "unit": metric.unit, "meaning": metric.meaning} for metric in posse.METRICS],
    }


def _settings(scenario: Scenario) -> dict[str, Any]:
    """Return every setting by name, with pairs as lists."""
    return {name: list(value) if isinstance(value, tuple) else value for name, value in scenario.to_dict().items()}


def _described(field: Field) -> dict[str, Any]:
    numbers = {"low": float(field.low), "high": float(field.high)}
    unknown = None if field.unknown is None else float(field.unknown)
    told = {"size": field.size, "unit": field.unit, **numbers, "meaning": field.meaning, "unknown": unknown}
    return {"name": field.name, "block": _block_of(field), **told}


def _block_of(field: Field) -> str:
    """Return the heading in the panel under which a field is listed."""
    if field.of_neighbour:
        return "team-mates"
    if field.name == "sonar":
        return "sonar"
    if field.name.startswith("target_"):
        return "target"
    return "own motion" if field.name in _OWN else "task"


def changed_settings(scenario: Scenario) -> dict[str, list[Any]]:
    """Return the settings that differ from the named scenario's: [there, here] by name.

    ``message_size`` is omitted, since it is set by the policy. A scenario with an unknown name is
    compared with the default settings.
    """
    try:
        named = get_scenario(scenario.name)
    except ScenarioError:
        named = get_scenario("constant")
    there, here = _settings(named), _settings(scenario)
    return {
        field.name: [there[field.name], here[field.name]]
        for field in dataclasses.fields(scenario)
        if field.name not in ("name", "message_size") and there[field.name] != here[field.name]
    }
