"""Candidates scored on a cluster: all of a generation at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from posse import Scenario
from posse_training.cluster.collect import Backend, Watcher, collect
from posse_training.cluster.shards import Arrays, Job, Shard, cut, joined
from posse_training.cluster.store import Memory
from posse_training.tuning.scoring import Scorer, Scores, TunablePolicy

_WORLDS: Final = 32
"""Worlds of a shard; scripted policies play each world alone, so it changes no score."""


class Elsewhere(Watcher):
    """The workers that score, and who is told of them.

    Args:
        backend: The workers.
        attempts: How many of them may die with one shard.
        tell: Called with a line about one that died.
    """

    def __init__(self, backend: Backend, attempts: int, tell: Callable[[str], object]) -> None:
        self._backend, self._attempts, self._tell = backend, attempts, tell
        self._report: Callable[[int], object] = lambda count: None
        self._done = 0

    def arrays(self, jobs: Sequence[Job], report: Callable[[int], object] = lambda count: None) -> list[Arrays]:
        """Return the arrays of each job; report how many shards are done."""
        self._report, self._done = report, 0
        store = Memory()
        failed = collect(jobs, self._backend, store, self, self._attempts)
        for error in failed.values():
            raise error
        return [joined(store.read(job)) for job in jobs]

    def done(self, job: Job, shard: Shard) -> None:
        """See :class:`~posse_training.cluster.collect.Watcher`."""
        self._done += 1
        self._report(self._done)

    def lost(self, job: Job, shard: Shard, why: str) -> None:
        """See :class:`~posse_training.cluster.collect.Watcher`."""
        self._tell(f"lost, and done again: {job.name} ({why})")


@dataclass(frozen=True)
class ClusterScorer(Scorer):
    """Scores on a cluster what its base class scores here, with the same result."""

    elsewhere: Elsewhere | None = None

    def metrics(
        self, values: dict[str, float], split: str, first: int, count: int, seed: int | None = None
    ) -> dict[str, Scores]:
        """See :class:`Scorer`."""
        job = self._job("validation", values, split, cut(count, _WORLDS, first), seed)
        (found,) = self._workers.arrays([job])
        self.played(count)
        return found

    def scores_of(
        self,
        candidates: Sequence[dict[str, float]],
        split: str,
        first: int,
        count: int,
        report: Callable[[int], object],
    ) -> list[Scores]:
        """See :class:`Scorer`."""
        shards = (Shard(first, count),)
        jobs = [self._job(f"candidate {k + 1}", values, split, shards, None) for k, values in enumerate(candidates)]
        found = self._workers.arrays(jobs, report)
        self.played(count * len(jobs))
        return [metrics["safe_score"] for metrics in found]

    @property
    def _workers(self) -> Elsewhere:
        assert self.elsewhere is not None
        return self.elsewhere

    def _job(self, name: str, values: dict[str, float], split: str, shards: tuple[Shard, ...], seed: int | None) -> Job:
        here = self.seed if seed is None else seed
        return Job(name, score_on_worker, (self.policy, self.scenario, values, split, here), shards)


def score_on_worker(
    policy: TunablePolicy, scenario: Scenario, values: dict[str, float], split: str, seed: int, shard: Shard
) -> Arrays:
    """Play a candidate in the worlds of a shard; return its metrics, (count,) each."""
    scorer = Scorer(policy, scenario, seed, threads=1)
    found = scorer.metrics(values, split, shard.first, shard.count)
    return {name: np.asarray(column) for name, column in found.items()}
