"""Plays a world with each policy and makes a replay of the trajectories."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from posse import Batch, Scenario, get_scenario
from posse_baselines import Policy, Target, Trajectory, against, load, load_target, rollout
from posse_baselines.playing import check_moves_all
from posse_training.errors import SettingsError
from posse_training.replay.columns import STATES, columns_of
from posse_training.replay.episode import MOST_PLAYERS, Player, Replay, join
from posse_training.replay.events import find_events
from posse_training.replay.world import PLACES, describe_world

RECORD: Final = (*STATES, *PLACES, "observations", "actions", "terms", "annotations")
"""Names of the arrays of a trajectory that a replay is made of."""
_LONGEST_ENTRY: Final = 400  # characters, of a card


def record(
    policies: Sequence[str | Policy | tuple[str, Policy]],
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
            (label, policy).
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
        PolicyError: A policy or target that is unknown or does not fit the scenario.
        ScenarioError: An unknown scenario or split, an invalid setting, seed or world.
    """
    settings = get_scenario(scenario, **overrides)
    opponent = None if target is None else load_target(target)
    if opponent is not None:
        settings = opponent.fit(settings)
    if not 1 <= len(policies) <= MOST_PLAYERS:
        raise SettingsError(f"a replay shows 1 to {MOST_PLAYERS} players, got {len(policies)} policies")
    if seconds is not None and not seconds > 0:
        raise SettingsError(f"seconds={seconds!r} must be above 0")
    steps = settings.horizon if seconds is None else max(1, round(seconds / settings.control_step))
    replays = []
    for given in policies:
        label, policy = given if isinstance(given, tuple) else (None, given)
        if isinstance(policy, str):
            policy = load(policy)
        player = against(policy, opponent)
        check_moves_all(player, settings)
        fitting = settings.replace(message_size=max(settings.message_size, policy.message_size))
        batch = Batch(fitting, 1, seed=seed, split=split, first_world=world, autoreset="disabled")
        played = rollout(batch, player, RECORD, steps=steps)
        replays.append(replay_of(played, label or policy.name, observations=observations, about=_about(policy)))
    return join(replays)


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
    described = describe_world(arrays, one, observations)
    events = find_events(arrays)
    metrics = {key: float(values[0]) for key, values in one.metrics.items()}
    columns = columns_of(arrays, one.layout, list(described["weights"]), observations)
    return Replay(described, (Player(name, columns, events, metrics, dict(about or {})),))


def _about(policy: Policy) -> dict[str, Any]:
    """Return a description of a policy, including the short entries of a learned one's card."""
    about: dict[str, Any] = {"reads_state": True} if policy.reads_state else {}
    card = getattr(policy, "card", None)
    for name, value in card.items() if isinstance(card, Mapping) else ():
        text = ", ".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)
        if not isinstance(value, Mapping) and len(text) <= _LONGEST_ENTRY:
            about[str(name)] = value if isinstance(value, (int, float)) else text
    return about
