"""Plays the contenders of a comparison on a cluster, all scenarios at once."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from posse import Scenario
from posse_baselines import Policy, PolicyError, against, load_target
from posse_training.cluster.collect import Watcher, collect
from posse_training.cluster.evaluation import evaluation_job
from posse_training.cluster.progress import ClusterProgress
from posse_training.cluster.ray_backend import RayBackend
from posse_training.cluster.settings import Cluster
from posse_training.cluster.shards import Job, joined
from posse_training.cluster.store import Folder
from posse_training.reports.comparing.contenders import Contender
from posse_training.reports.comparing.players import Play, Players
from posse_training.reports.results import Results


class _Known(NamedTuple):
    """What a driver knows of a policy that it has not loaded."""

    name: str
    message_size: int


class ClusterPlayers(Players):
    """Plays contenders on a Ray cluster; results of a killed driver are found again.

    Args:
        time_limit: Time for one shard, s.
        target: What :func:`evaluate` takes; default: the scenarios' own.
        cluster: The cluster.

    Raises:
        MissingExtraError: Ray is not installed.
    """

    def __init__(self, time_limit: float, target: str | None, cluster: Cluster) -> None:
        super().__init__(time_limit, target)
        self._opponent = None if target is None else load_target(target)
        self._cluster = cluster
        self._store = Folder(cluster.work)
        self._backend = RayBackend(cluster)
        self._known: dict[str, _Known] = {}
        self._failed: dict[str, Exception] = {}
        self._open = contextlib.ExitStack()

    def __enter__(self) -> ClusterPlayers:
        self._open.enter_context(self._backend)
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()
        super().__exit__()

    def check(self, contender: Contender) -> None:
        """See :class:`~posse_training.reports.comparing.players.Players`."""
        for policy in contender.policies:
            if isinstance(policy, str):
                self._known[policy] = _Known(*self._load_elsewhere(policy))

    def expect(self, plays: Iterable[Play], seed: int, split: str) -> None:
        """Play everything that will be asked for in parallel."""
        jobs: dict[Any, Job] = {}
        for contender, scenario, episodes in plays:
            for policy in contender.policies:
                with contextlib.suppress(PolicyError):  # left out when it is asked for
                    job = self._job(policy, scenario, episodes, seed, split)
                    jobs[job.key, job.shards] = job
        with ClusterProgress("comparison") as watcher:
            self._collect(list(jobs.values()), watcher)

    def forget(self) -> None:
        """See :class:`~posse_training.reports.comparing.players.Players`."""
        self._store.clear()

    def _play(
        self,
        policy: str | Policy,
        scenario: Scenario,
        episodes: int,
        seed: int,
        split: str,
        advance: Callable[[int], object],
    ) -> Results:
        job = self._job(policy, scenario, episodes, seed, split)
        if job.key not in self._failed and self._store.missing(job):  # not expected
            self._collect([job], Watcher())
        if job.key in self._failed:
            raise self._failed[job.key]
        name, _ = self._of(policy)
        settings: Scenario = job.arguments[1]
        opponent = None if self._opponent is None else self._opponent.name
        return Results(name, settings, seed, split, joined(self._store.read(job)), opponent)

    def _job(self, policy: str | Policy, scenario: Scenario, episodes: int, seed: int, split: str) -> Job:
        name, size = self._of(policy)
        if self._opponent is not None:
            scenario = self._opponent.fit(scenario)
            if not isinstance(policy, str):
                against(policy, self._opponent)  # raises here if it cannot play against it
        fitted = scenario.replace(message_size=max(scenario.message_size, size))
        return evaluation_job(policy, name, fitted, episodes, seed, split, self._cluster, self._limit, self._opponent)

    def _of(self, policy: str | Policy) -> _Known:
        if isinstance(policy, str):
            return self._known[policy]
        return _Known(policy.name, policy.message_size)

    def _collect(self, jobs: list[Job], watcher: Watcher) -> None:
        failed = collect(jobs, self._backend, self._store, watcher, self._cluster.attempts)
        self._failed |= {job.key: error for job, error in failed.items()}
