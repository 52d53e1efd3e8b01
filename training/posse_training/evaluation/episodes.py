"""One episode in every world of a batch, measured."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from posse import Family, Scenario
from posse.scenarios.family import blocks
from posse_baselines import Played, Policy, Target, batch_for, load, rollout
from posse_training.errors import TrainedSplitError
from posse_training.evaluation.results import Column
from posse_training.parallel import joined


def refuse_trained_split(policy: Policy | Target, split: str) -> None:
    """Raise if a policy or a target was trained on this split, by its own account."""
    trained = tuple(getattr(policy, "trained_splits", ()))
    if split in trained:
        raise TrainedSplitError(
            f"{policy.name!r} was trained on the split {split!r}, so that its score there would be "
            "biased: choose another of 'train', 'validation', 'test' than "
            f"{', '.join(map(repr, trained))}"
        )


class Match(NamedTuple):
    """Who plays against whom, and where."""

    policy: str | Policy
    """Or its name."""
    target: Target | None
    scenario: Scenario | Family
    seed: int
    split: str


def play_shard(
    match: Match, shard: range, *, num_threads: int | None = None, advance: Callable[[], object] | None = None
) -> dict[str, Column]:
    """Play one episode in every world of a shard; return every metric by name, (worlds,).

    They are the batch's metrics and ``leader_exchanges``: how often the leader of the majority changed, ``nan`` for
    policies without leaders. ``advance`` is called after each control step of a batch.
    """
    policy = load(match.policy) if isinstance(match.policy, str) else match.policy
    where: dict[str, Any] = {"seed": match.seed, "split": match.split}
    played = []
    for one, worlds in blocks(match.scenario, shard, **where):
        place = {**where, "first_world": worlds.start, "num_threads": num_threads}
        exchanges = ExchangeCounter(len(worlds))

        def note(step: Played, exchanges: ExchangeCounter = exchanges) -> None:
            exchanges.count(policy.annotations(step.memory).get("leader"), step.running)
            if advance is not None:
                advance()

        batch = batch_for(policy, one, len(worlds), match.target, **place)
        played.append(rollout(batch, policy, after_step=note).metrics | {"leader_exchanges": exchanges.total})
    return joined(played)


def majority(leaders: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return whom more than half of a team follow, (E,) of the leader of each tracker, (E, N); -1: there is none."""
    n = leaders.shape[1]
    middle = np.sort(leaders, axis=1)[:, n // 2]  # a leader of more than half stands there
    agreed = np.count_nonzero(leaders == middle[:, None], axis=1) > n / 2
    return np.where(agreed, middle, -1)


class ExchangeCounter:
    """Counts in each world how often the leader of the majority changes."""

    def __init__(self, num_worlds: int) -> None:
        self.total: Column = np.full(num_worlds, np.nan)
        self._leader = np.full(num_worlds, -1)
        self._seen: npt.NDArray[Any] = np.empty(0)

    def count(self, leaders: npt.NDArray[Any] | None, running: npt.NDArray[np.bool_]) -> None:
        """Add one step: the leader of each tracker, (E, N); ``None``: there is none."""
        if leaders is None or np.array_equal(leaders, self._seen):
            return
        self._seen = leaders.copy()
        chosen = majority(leaders)
        known = (chosen >= 0) & running
        self.total[known & np.isnan(self.total)] = 0
        self.total[known & (self._leader >= 0) & (chosen != self._leader)] += 1
        self._leader[known] = chosen[known]
