"""Plays a world with each policy, and makes a replay of the trajectories: columns, events, and a description."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy.typing as npt

import posse
from posse import REWARD_TERMS, Field, Scenario, get_scenario, scenario_names
from posse_baselines import Policy, Target, Trajectory, batch_for, load, load_target, rollout
from posse_baselines.ddcs import TASKS
from posse_training.errors import SettingsError
from posse_training.options import settings_of, words_of
from posse_training.provenance import commit
from posse_training.replay.columns import STATES, columns_of
from posse_training.replay.episode import MOST_PLAYERS, Player, Replay, join
from posse_training.replay.events import find_events

_PLACES: Final = ("world_seed", "world_index", "world_episode", "obstacle_x", "obstacle_y", "obstacle_radius")
RECORD: Final = (*STATES, *_PLACES, "observations", "actions", "terms", "annotations")
"""Names of the arrays of a trajectory that a replay is made of."""
_LONGEST_ENTRY: Final = 400  # characters, of a card
_OWN: Final = ("heading", "position", "speed", "turn_rate", "touching", "working")  # fields of the own motion


def record(
    policies: Sequence[str | Policy | tuple[str, str | Policy]],
    scenario: str | Scenario = "smart",
    *,
    target: str | Target | None = None,
    seed: int = 7,
    world: int = 0,
    split: str = "test",
    seconds: float | None = None,
    observations: bool = True,
    **overrides: Any,
) -> Replay:
    """Play one world with each policy.

    Args:
        policies: One to four: names (see :func:`posse_baselines.load`), policies, or pairs
            (label, name or policy).
        scenario: Scenario or its name; ``message_size`` is raised to that of each policy.
        target: A target, or an argument of :func:`posse_baselines.load_target`; default: the
            scenario's own motion.
        seed: Seed of the world.
        world: Index of the world within the seed.
        split: ``"train"``, ``"validation"`` or ``"test"``.
        seconds: Longest duration, s; ``None``: the whole episode.
        observations: Whether to keep all observations, which are most of a page's size.
        **overrides: Settings of the scenario.

    Raises:
        SettingsError: No policy, more than four, ``seconds`` not above 0.
        PolicyError, ScenarioError: An argument that is unknown, invalid, or does not fit the scenario.
    """
    settings = own = get_scenario(scenario, **overrides)
    opponent = None if target is None else load_target(target)
    if not 1 <= len(policies) <= MOST_PLAYERS:
        raise SettingsError(f"a replay shows 1 to {MOST_PLAYERS} players, got {len(policies)} policies")
    if seconds is not None and not seconds > 0:
        raise SettingsError(f"seconds={seconds!r} must be above 0")
    steps = settings.horizon if seconds is None else max(1, round(seconds / settings.control_step))
    options = _options(own, observations, target=target, world=world, seed=seed, split=split, seconds=seconds)
    replays = []
    for given in policies:
        label, policy = given if isinstance(given, tuple) else (None, given)
        argument = policy if isinstance(policy, str) else ""
        if isinstance(policy, str):
            policy = load(policy)
        place: dict[str, Any] = {"seed": seed, "split": split, "first_world": world}
        batch = batch_for(policy, settings, 1, opponent, **place, autoreset="disabled")
        played = rollout(batch, policy, RECORD, steps=steps)
        one = replay_of(played, label or policy.name, observations=observations, about=_about(policy))
        players = tuple(replace(player, argument=argument) for player in one.players)
        replays.append(Replay(one.world | {"options": options}, players))
    return join(replays)


def _options(scenario: Scenario, observations: bool, **played: object) -> list[str] | None:
    """Return the options with which ``posse replay`` plays this world; ``None``: it has none for some setting."""
    if scenario.name not in scenario_names() or not isinstance(played["target"], str | None):
        return None
    named = get_scenario(scenario.name).to_dict()
    changed = {name: value for name, value in scenario.to_dict().items() if named[name] != value}
    settings = words_of(changed)
    if settings_of(settings) != changed:
        return None
    words: list[str] = []
    for name, value in {"scenario": scenario.name, **played}.items():
        if value is not None:
            words += [f"--{name}", f"{value:.10g}" if isinstance(value, float) else str(value)]
    words += [] if observations else ["--no-observations"]
    return [*words, "--set", *settings] if settings else words


def replay_of(
    trajectory: Trajectory,
    name: str,
    *,
    world: int = 0,
    observations: bool = True,
    about: Mapping[str, Any] | None = None,
) -> Replay:
    """Return the first episode of a world as a replay with one player.

    Args:
        trajectory: Has the arrays that :data:`RECORD` names; annotations may be missing.
        name: Name of the player on the page.
        world: Index in the trajectory.
        observations: Whether to keep all observations, which are most of a page's size.
        about: Description of the policy; plain JSON.
    """
    one = trajectory.episode(world)
    arrays = {key: array[:, 0] for key, array in one.arrays.items()}
    described = _describe_world(arrays, one, observations)
    metrics = {key: float(values[0]) for key, values in one.metrics.items()}
    columns = columns_of(arrays, one.layout, list(described["weights"]), observations)
    return Replay(described, (Player(name, columns, find_events(arrays), metrics, dict(about or {})),))


def _about(policy: Policy) -> dict[str, Any]:
    """Return a description of a policy, including the short entries of a learned one's card."""
    about: dict[str, Any] = {"reads_state": True} if policy.reads_state else {}
    card = getattr(policy, "card", None)
    for name, value in card.items() if isinstance(card, Mapping) else ():
        text = ", ".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)
        if not isinstance(value, Mapping) and len(text) <= _LONGEST_ENTRY:
            about[str(name)] = value if isinstance(value, (int, float)) else text
    return about


def _describe_world(
    arrays: Mapping[str, npt.NDArray[Any]], trajectory: Trajectory, observations: bool
) -> dict[str, Any]:
    """Return the common data of all players of a world, as plain JSON with infinite numbers."""
    scenario = trajectory.scenario
    start = {name: arrays[name][0] for name in _PLACES}
    weights = {name: weight for name, weight in dict(scenario.reward_weights).items() if weight}
    named = _settings(get_scenario(scenario.name if scenario.name in scenario_names() else "constant"))
    settings = _settings(scenario)
    return {
        "posse": posse.__version__,
        "commit": commit(),
        "scenario": scenario.name,
        "version": scenario.version,
        "settings": settings,
        # The size of a message is set by the policy.
        "changed": {
            name: [named[name], value]
            for name, value in settings.items()
            if name not in ("name", "meaning", "message_size") and named[name] != value
        },
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
        "terms": [_meaning(term) for term in REWARD_TERMS if term.name in weights],
        "fields": [_field(field) for field in trajectory.layout.fields if observations or field.name == "sonar"],
        "metrics": [_meaning(metric) for metric in posse.METRICS],
    }


def _settings(scenario: Scenario) -> dict[str, Any]:
    """Return every setting by name, with pairs as lists, as JSON has them."""
    return {name: list(value) if isinstance(value, tuple) else value for name, value in scenario.to_dict().items()}


def _meaning(declared: Any) -> dict[str, str]:
    return {"name": declared.name, "unit": declared.unit, "meaning": declared.meaning}


def _field(field: Field) -> dict[str, Any]:
    """Return the description of a field, with the block of the panel that lists it."""
    if field.of_neighbour:
        block = "team-mates"
    elif field.name == "sonar":
        block = "sonar"
    elif field.name.startswith("target_"):
        block = "target"
    else:
        block = "own motion" if field.name in _OWN else "task"
    unknown = None if field.unknown is None else float(field.unknown)
    numbers = {"size": field.size, "low": float(field.low), "high": float(field.high), "unknown": unknown}
    return {**_meaning(field), **numbers, "block": block}
