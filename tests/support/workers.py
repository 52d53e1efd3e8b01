"""Workers of a cluster without Ray: this process, in which they may die."""

from __future__ import annotations

from collections.abc import Callable, Hashable

from posse_training.cluster.collect import Outcome
from posse_training.cluster.shards import Job, Shard


class Here:
    """Does shards in this process, the last one given out first; what ``fate`` says may happen."""

    def __init__(self, fate: Callable[[Job, Shard, int], Outcome | None] = lambda *_: None) -> None:
        self.started: list[tuple[str, Shard]] = []
        self._fate = fate
        self._out: dict[Hashable, tuple[Job, Shard]] = {}

    def workers(self) -> int:
        return 2

    def start(self, job: Job, shard: Shard) -> Hashable:
        self.started.append((job.name, shard))
        self._out[len(self.started)] = job, shard
        return len(self.started)

    def finished(self, timeout: float) -> list[tuple[Hashable, Outcome]]:
        ticket, (job, shard) = self._out.popitem()
        attempt = self.started.count((job.name, shard))
        outcome = self._fate(job, shard, attempt)
        return [(ticket, outcome or Outcome(arrays=job.function(*job.arguments, shard)))]

    def cancel(self, ticket: Hashable) -> None:
        self._out.pop(ticket, None)
