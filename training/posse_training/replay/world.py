"""Description of a recorded world for the page: scenario, settings, positions."""

from __future__ import annotations

import dataclasses
from typing import Any, Final

import posse
from posse import REWARD_TERMS, Batch, Field, Scenario, ScenarioError, get_scenario
from posse_baselines.ddcs import TASKS
from posse_training.provenance import commit

_OWN: Final = ("heading", "position", "speed", "turn_rate", "touching", "working")
_BLOCKS: Final = ("own motion", "task", "target", "sonar", "team-mates")


def describe_world(batch: Batch, world: int, observations: bool) -> dict[str, Any]:
    """Return the common data of all players of a world, as plain JSON with infinite numbers.

    Without ``observations``, the sonar is the only observation field described.
    """
    scenario, state = batch.scenario, batch.state
    weights = {name: weight for name, weight in dict(scenario.reward_weights).items() if weight}
    return {
        "posse": posse.__version__,
        "commit": commit(),
        "scenario": scenario.name,
        "version": scenario.version,
        "settings": _settings(scenario),
        "changed": changed_settings(scenario),
        "seed": int(state["world_seed"][world]),
        "split": batch.split,
        "world": int(state["world_index"][world]),
        "episode": int(state["world_episode"][world]),
        "agents": scenario.num_agents,
        "slots": [[float(x), float(y)] for x, y in scenario.slot_offsets],
        "obstacles": [
            [float(state[f"obstacle_{name}"][world, k]) for name in ("x", "y", "radius")]
            for k in range(scenario.num_obstacles)
        ],
        "tasks": list(TASKS),
        "weights": weights,
        "terms": [
            {"name": term.name, "unit": term.unit, "meaning": term.meaning}
            for term in REWARD_TERMS
            if term.name in weights
        ],
        "fields": [_describe(field) for field in batch.layout.fields if observations or field.name == "sonar"],
        "metrics": [{"name": metric.name, "unit": metric.unit, "meaning": metric.meaning} for metric in posse.METRICS],
    }


def _settings(scenario: Scenario) -> dict[str, Any]:
    """Return every setting by name, with pairs as lists."""
    return {name: list(value) if isinstance(value, tuple) else value for name, value in scenario.to_dict().items()}


def _describe(field: Field) -> dict[str, Any]:
    return {
        "name": field.name,
        "block": block_of(field),
        "size": field.size,
        "unit": field.unit,
        "low": float(field.low),
        "high": float(field.high),
        "meaning": field.meaning,
        "unknown": None if field.unknown is None else float(field.unknown),
    }


def block_of(field: Field) -> str:
    """Return the heading in the panel under which a field is listed."""
    if field.of_neighbour:
        return _BLOCKS[4]
    if field.name == "sonar":
        return _BLOCKS[3]
    if field.name.startswith("target_"):
        return _BLOCKS[2]
    return _BLOCKS[0] if field.name in _OWN else _BLOCKS[1]


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
