"""Plays a world with each policy, and makes a replay of the trajectories: columns, events, and a description."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

import posse
from posse import Field, Scenario, get_scenario, scenario_names
from posse.declarations import Declarations
from posse_baselines import Policy, Target, Trajectory, batch_for, load, load_target, rollout
from posse_baselines.ddcs import TASKS
from posse_training.errors import SettingsError
from posse_training.evaluation.episodes import refuse_two_targets
from posse_training.evaluation.evaluation import played_errors
from posse_training.options import settings_of, words_of
from posse_training.provenance import commit
from posse_training.replay.columns import columns_of, find_events
from posse_training.replay.episode import Player, Replay, join

RECORD: Final = ("state", "observations", "actions", "terms", "annotations")
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
        policies: One to four: names (see :func:`posse_baselines.load`), policies, or pairs (label, name or policy).
        scenario: Scenario or its name; ``message_size`` is raised to that of each policy.
        target: A target, or an argument of :func:`posse_baselines.load_target`; default: the scenario's own motion.
        seed: Seed of the world.
        world: Index of the world within the seed.
        split: ``"train"``, ``"validation"`` or ``"test"``.
        seconds: Longest duration, s; ``None``: the whole episode.
        observations: Whether to keep all observations, which are most of a page's size.
        **overrides: Settings of the scenario.

    Raises:
        SettingsError: No policy, more than four, ``seconds`` not above 0.
        PolicyError, ScenarioError: An argument that is unknown, invalid, or does not fit the scenario.
        PlayError: A policy that raised, or returned invalid actions.
    """
    refuse_two_targets(target, overrides)
    settings = get_scenario(scenario, **overrides)
    opponent = None if target is None else load_target(target)
    if seconds is not None and not seconds > 0:
        raise SettingsError(f"seconds={seconds!r} must be above 0")
    longest = settings.duration if seconds is None else min(seconds, settings.duration)
    steps = max(1, round(longest / settings.control_step))
    options = _options(settings, observations, target=target, world=world, seed=seed, split=split, seconds=seconds)
    place: dict[str, Any] = {"seed": seed, "split": split, "first_world": world}
    moved_by = target.name if isinstance(target, Target) else str(target)
    replays = []
    for given in (policies,) if isinstance(policies, str) else policies:
        label, policy = given if isinstance(given, tuple) else ("", given)
        loaded = load(policy)
        batch = batch_for(loaded, settings, 1, opponent, **place, autoreset="disabled")
        with played_errors():
            played = rollout(batch, loaded, RECORD, steps=steps)
        one = replay_of(played, label or loaded.name, observations=observations, about=_about(loaded))
        player = replace(one.players[0], argument=policy if isinstance(policy, str) else "")
        replays.append(Replay(one.world | {"options": options, "moved_by": moved_by}, (player,)))
    return join(replays)


def _options(scenario: Scenario, observations: bool, **played: object) -> list[str] | None:
    """Return the options with which ``posse replay`` plays this world; ``None``: it has none for some setting."""
    changed = {name: here for name, (_, here) in _changed(scenario).items()}
    settings = words_of(changed)
    nameable = scenario.name in scenario_names() and isinstance(played["target"], str | None)
    if not nameable or settings_of(settings) != changed:
        return None
    words: list[str] = []
    for name, value in {"scenario": scenario.name, **played}.items():
        if value is not None:
            words += [f"--{name}", f"{value:.10g}" if isinstance(value, float) else str(value)]
    words += [] if observations else ["--no-observations"]
    words += [word for module in Declarations.of(scenario).modules for word in ("--import", module)]
    return [*words, "--set", *settings] if settings else words


def _changed(scenario: Scenario) -> dict[str, tuple[Any, Any]]:
    """Return the settings that are not those of the scenario of this name, or else of ``constant``: old and new."""
    named = get_scenario(scenario.name if scenario.name in scenario_names() else "constant").to_dict()
    return {name: (named[name], value) for name, value in scenario.to_dict().items() if named[name] != value}


def replay_of(
    trajectory: Trajectory, name: str, *, observations: bool = True, about: Mapping[str, Any] | None = None
) -> Replay:
    """Return the first episode of a trajectory's first world as a replay with one player.

    Args:
        trajectory: Has the arrays that :data:`RECORD` names; annotations may be missing. Of another world:
            :meth:`posse_baselines.Trajectory.episode`.
        name: Name of the player on the page.
        observations: Whether to keep all observations, which are most of a page's size.
        about: Description of the policy; plain JSON.
    """
    one = trajectory.episode(0)
    arrays = {key: array[:, 0] for key, array in one.arrays.items()}
    fields = [field for field in one.layout.fields if observations or field.name == "sonar"]
    world = _describe_world(arrays, one, fields)
    metrics = {key: float(values[0]) for key, values in one.metrics.items()}
    columns = columns_of(arrays, one.layout, world)
    return Replay(world, (Player(name, columns, find_events(arrays), metrics, dict(about or {})),))


def _about(policy: Policy) -> dict[str, Any]:
    """Return a description of a policy, including the short entries of a learned one's card."""
    about: dict[str, Any] = {"reads_state": True} if policy.reads_state else {}
    card = getattr(policy, "card", None)
    for name, value in card.items() if isinstance(card, Mapping) else ():
        text = ", ".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)
        if not isinstance(value, Mapping) and len(text) <= _LONGEST_ENTRY:
            about[name] = value if isinstance(value, (int, float)) else text
    return about


def _describe_world(
    arrays: Mapping[str, npt.NDArray[Any]], trajectory: Trajectory, fields: Sequence[Field]
) -> dict[str, Any]:
    """Return the common data of all players of a world, as plain JSON with infinite numbers."""
    scenario = trajectory.scenario
    world = {
        "posse": posse.__version__,
        "commit": commit(),
        "settings": scenario.to_dict(),
        # The size of a message is set by the policy.
        "changed": {
            name: both for name, both in _changed(scenario).items() if name not in ("name", "meaning", "message_size")
        },
        "seed": int(arrays["world_seed"][0]),
        "split": trajectory.split,
        "world": int(arrays["world_index"][0]),
        "episode": int(arrays["world_episode"][0]),
        "agents": scenario.num_agents,
        "slots": scenario.slot_offsets,
        "obstacles": np.stack([arrays[f"obstacle_{name}"][0] for name in ("x", "y", "radius")], axis=-1).tolist(),
        "tasks": TASKS,
        "terms": [
            _meaning(t) for t in Declarations.of(scenario).reward_terms if dict(scenario.reward_weights).get(t.name)
        ],
        "fields": [_field(field) for field in fields],
        "metrics": [_meaning(metric) for metric in posse.METRICS],
    }
    plain: dict[str, Any] = json.loads(json.dumps(world))  # with lists for tuples, as it is read from a page
    return plain


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
    return {**_meaning(field), "unknown": unknown, "block": block}
