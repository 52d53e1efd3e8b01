"""One episode in every world of a batch, measured."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from posse import Family, Scenario
from posse.scenarios.family import blocks
from posse_baselines import Policy, Target, batch_for, load, rollout
from posse_training.errors import SettingsError
from posse_training.evaluation.results import Column
from posse_training.parallel import joined


def refuse_trained_split(policy: Any, split: str) -> None:
    """Raise if a policy or a target was trained on this split, by its own account; a name or ``None`` has none."""
    trained = tuple(getattr(policy, "trained_splits", ()))
    if split in trained:
        raise SettingsError(
            f"{policy.name!r} was trained on the split {split!r}, so that its score there would be biased: name "
            f"another policy, or another split than {', '.join(map(repr, trained))}"
        )


def refuse_two_targets(target: object, overrides: Mapping[str, Any]) -> None:
    """Raise if a target is given, and the motion of the scenario's own one, too."""
    if target is not None and (motion := overrides.get("target_motion")) is not None:
        raise SettingsError(f"target_motion={motion!r} and a target exclude each other: leave one out")


class Match(NamedTuple):
    """Who plays against whom, and where."""

    policy: str | Policy
    """Or its name."""
    target: Target | None
    scenario: Scenario | Family
    seed: int
    split: str


def play_shard(
    match: Match, shard: range, *, num_threads: int | None = None, advance: Callable[[], object] = lambda: None
) -> dict[str, Column]:
    """Play one episode in every world of a shard; return every metric by name, (worlds,).

    ``advance`` is called after each control step of a batch.
    """
    policy = load(match.policy)
    where: dict[str, Any] = {"seed": match.seed, "split": match.split}
    played = []
    for one, worlds in blocks(match.scenario, shard, **where):
        place = {**where, "first_world": worlds.start, "num_threads": num_threads}
        batch = batch_for(policy, one, len(worlds), match.target, **place)
        played.append(rollout(batch, policy, after_step=lambda _: advance()).metrics)
    return joined(played)
