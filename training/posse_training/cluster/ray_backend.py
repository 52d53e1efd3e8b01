"""The workers of a Ray cluster: one plain task for each shard."""

from __future__ import annotations

import math
import platform
import time
from collections.abc import Hashable
from typing import Any, Final, Self
from weakref import WeakKeyDictionary

from posse_training.cluster.collect import Outcome
from posse_training.cluster.identity import installed
from posse_training.cluster.settings import Cluster, check_reachable, no_cluster
from posse_training.cluster.shards import Job, Shard
from posse_training.errors import ClusterError, require

_LONGEST: Final = 200  # characters of why a worker died
_ASK_AGAIN: Final = 1.0  # s between two questions how many workers there are


class RayBackend:
    """A connection to a Ray cluster, open while the context is.

    Ray's own retries are off: :func:`posse_training.cluster.collect.collect` counts and shows them.

    Args:
        cluster: Which.
        log: Show what the workers print.

    Raises:
        MissingExtraError: Ray is not installed.
    """

    def __init__(self, cluster: Cluster, *, log: bool = False) -> None:
        require("cluster", "ray")
        self._cluster, self._log = cluster, log
        self._shared: WeakKeyDictionary[Job, Any] = WeakKeyDictionary()
        self._out: set[Any] = set()
        self._cpus, self._asked = 0, -math.inf

    def __enter__(self) -> Self:
        import ray

        self._ray = ray
        self._connected = not ray.is_initialized()
        if self._connected:
            address = self._cluster.address
            check_reachable(address)
            try:
                ray.init(address=address, log_to_driver=self._log, logging_level="warning")
            except (ConnectionError, ValueError, RuntimeError) as error:
                raise no_cluster(address, error) from error
        self._task = ray.remote(num_cpus=1, max_retries=0)(_work)
        return self

    def __exit__(self, *_: object) -> None:
        for ticket in tuple(self._out):
            self.cancel(ticket)
        if self._connected:
            self._ray.shutdown()

    def workers(self) -> int:
        """See :class:`~posse_training.cluster.collect.Backend`."""
        if time.monotonic() > self._asked + _ASK_AGAIN:
            self._cpus = int(self._ray.cluster_resources().get("CPU", 0))
            self._asked = time.monotonic()
        return self._cpus

    def start(self, job: Job, shard: Shard) -> Hashable:
        """See :class:`~posse_training.cluster.collect.Backend`."""
        if job not in self._shared:  # sent to each node once, not with each shard
            self._shared[job] = self._ray.put((job.function, job.arguments))
        ticket: Hashable = self._task.remote(self._shared[job], shard, installed())
        self._out.add(ticket)
        return ticket

    def finished(self, timeout: float) -> list[tuple[Hashable, Outcome]]:
        """See :class:`~posse_training.cluster.collect.Backend`."""
        ready, rest = self._ray.wait(list(self._out), num_returns=1, timeout=timeout)
        if ready and rest:  # and whatever else has ended by now
            more, _ = self._ray.wait(rest, num_returns=len(rest), timeout=0)
            ready = [*ready, *more]
        self._out.difference_update(ready)
        return [(ticket, self._outcome(ticket)) for ticket in ready]

    def cancel(self, ticket: Hashable) -> None:
        """See :class:`~posse_training.cluster.collect.Backend`."""
        self._out.discard(ticket)
        self._ray.cancel(ticket, force=True)

    def _outcome(self, ticket: Any) -> Outcome:
        errors = self._ray.exceptions
        try:
            outcome: Outcome = self._ray.get(ticket)
        except errors.RayTaskError as error:  # raised before or after _work's own code
            return Outcome(error=error)
        except errors.RayError as error:  # worker, node or object are gone
            why = " ".join(str(error).split())[:_LONGEST]
            return Outcome(lost=f"{type(error).__name__}: {why}")
        return outcome


def _work(call: tuple[Any, tuple[Any, ...]], shard: Shard, expected: str) -> Outcome:
    """Do a shard on a worker whose sources and versions are the driver's."""
    if installed() != expected:
        return Outcome(
            error=ClusterError(
                f"node {platform.node()} has {installed()}, and the driver {expected}: install "
                "the same on all nodes, else results would not be those of one machine"
            )
        )
    function, arguments = call
    try:
        return Outcome(arrays=function(*arguments, shard))
    except Exception as error:  # returned: Ray reports errors that nobody fetches
        return Outcome(error=error)
