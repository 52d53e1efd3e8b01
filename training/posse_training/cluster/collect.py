"""Collects the shards of jobs from workers that may die; knows nothing of Ray."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

from posse_training.cluster.shards import Arrays, Job, Shard
from posse_training.cluster.store import Store
from posse_training.errors import ClusterError

_LEAST_AHEAD: Final = 16  # shards given out, however few workers there are
_WAIT: Final = 1.0  # s between two looks at how many workers there are


@dataclass(frozen=True)
class Outcome:
    """What became of a shard: results, the error that its function raised, or its worker died.

    Attributes:
        arrays: The results.
        error: What the function raised.
        lost: Why there is neither.
    """

    arrays: Arrays | None = None
    error: Exception | None = None
    lost: str = ""


class Backend(Protocol):
    """Workers somewhere."""

    def workers(self) -> int:
        """Return how many shards can be worked on at once, at present."""
        ...

    def start(self, job: Job, shard: Shard) -> Hashable:
        """Give out a shard; return a ticket."""
        ...

    def finished(self, timeout: float) -> list[tuple[Hashable, Outcome]]:
        """Return what has ended since the last call; wait for the first, s at most."""
        ...

    def cancel(self, ticket: Hashable) -> None:
        """Cancel a shard; its outcome may still arrive."""
        ...


class Watcher:
    """Is notified of progress; this one shows nothing."""

    def begin(self, jobs: Sequence[Job], kept: int) -> None:
        """Work begins; results of ``kept`` shards were found."""

    def state(self, given_out: int, workers: int) -> None:
        """So many shards are given out to so many workers."""

    def done(self, job: Job, shard: Shard) -> None:
        """The results of a shard are kept."""

    def lost(self, job: Job, shard: Shard, why: str) -> None:
        """A worker died with a shard, which is given out again."""

    def failed(self, job: Job, error: Exception) -> None:
        """A job failed; its other shards are dropped."""


def collect(
    jobs: Sequence[Job], backend: Backend, store: Store, watcher: Watcher, attempts: int = 4
) -> dict[Job, Exception]:
    """Compute all shards that the store lacks; return the jobs that failed, with their errors.

    A shard whose worker dies is given out again, up to ``attempts`` times in all. Results are
    stored under their shard, so none is lost or doubled. An error that a shard's function raises
    ends its job, and no other.
    """
    waiting = deque((job, shard) for job in jobs for shard in store.missing(job))
    watcher.begin(jobs, sum(len(job.shards) for job in jobs) - len(waiting))
    out: dict[Hashable, tuple[Job, Shard]] = {}
    deaths: Counter[tuple[Job, Shard]] = Counter()
    failed: dict[Job, Exception] = {}

    def fail(job: Job, error: Exception) -> None:
        failed[job] = error
        watcher.failed(job, error)
        for ticket in [t for t, (of, _) in out.items() if of is job]:
            backend.cancel(ticket)
            del out[ticket]

    try:
        while waiting or out:
            workers = backend.workers()
            while waiting and len(out) < max(_LEAST_AHEAD, 2 * workers):
                job, shard = waiting.popleft()
                if job not in failed:
                    out[backend.start(job, shard)] = job, shard
            if not out:  # what was waiting belonged to jobs that have failed
                break
            watcher.state(len(out), workers)
            for ticket, outcome in backend.finished(_WAIT):
                if ticket not in out:  # of a job that has failed
                    continue
                job, shard = out.pop(ticket)
                if outcome.arrays is not None:
                    store.write(job, shard, outcome.arrays)
                    watcher.done(job, shard)
                elif outcome.error is not None:
                    fail(job, outcome.error)
                else:
                    deaths[job, shard] += 1
                    if deaths[job, shard] < attempts:
                        watcher.lost(job, shard, outcome.lost)
                        waiting.appendleft((job, shard))
                    else:
                        fail(job, _died(job, shard, attempts, outcome.lost))
    finally:
        for ticket in out:
            backend.cancel(ticket)
    return failed


def _died(job: Job, shard: Shard, attempts: int, why: str) -> ClusterError:
    return ClusterError(
        f"{job.name}: {attempts} workers died with worlds {shard.first} to "
        f"{shard.first + shard.count - 1}; the last one: {why}"
    )
