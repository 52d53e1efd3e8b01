"""One episode in every world of a batch, measured."""

from __future__ import annotations

import time
from collections.abc import Callable

import posse
from posse import Scenario
from posse_baselines import Played, Policy, Target, rollout
from posse_training.cluster.shards import Shard
from posse_training.errors import TimeLimitError, TrainedSplitError
from posse_training.reports.exchanges import ExchangeCounter, leaders_of
from posse_training.reports.results import Column


def refuse_trained_split(policy: Policy | Target, split: str) -> None:
    """Raise if a policy or a target was trained on this split, by its own account."""
    trained = tuple(getattr(policy, "trained_splits", ()))
    if split in trained:
        raise TrainedSplitError(
            f"{policy.name!r} was trained on the split {split!r}, so that its score there would be "
            "biased: choose another of 'train', 'validation', 'test' than "
            f"{', '.join(map(repr, trained))}"
        )


def limited(advance: Callable[[int], object], time_limit: float | None) -> Callable[[int], object]:
    """Return a function that calls another one, and raises once a time limit is exceeded."""
    if time_limit is None:
        return advance
    ends = time.monotonic() + time_limit

    def check(steps: int) -> None:
        if time.monotonic() > ends:
            raise TimeLimitError(f"it exceeded the time limit of {time_limit:g} s")
        advance(steps)

    return check


def play_shard(
    policy: Policy,
    scenario: Scenario,
    shard: Shard,
    seed: int,
    split: str,
    num_threads: int | None,
    advance: Callable[[int], object],
) -> dict[str, Column]:
    """Play one episode in every world of a shard; return every metric by name, (count,)."""
    batch = posse.Batch(scenario, shard.count, seed=seed, split=split, first_world=shard.first, num_threads=num_threads)
    return play_episode(batch, policy, advance)


def play_episode(
    batch: posse.Batch, policy: Policy, advance: Callable[[int], object] = lambda steps: None
) -> dict[str, Column]:
    """Play one episode in every world of a batch; return every metric by name, (E,).

    They are the batch's metrics and ``leader_exchanges``: how often the leader of the majority
    changed, ``nan`` for policies without leaders.
    """
    exchanges = ExchangeCounter(batch.num_worlds)

    def note(step: Played) -> None:
        exchanges.count(leaders_of(policy, step.memory), step.running)
        advance(1)

    return rollout(batch, policy, after_step=note).metrics | {"leader_exchanges": exchanges.total}
