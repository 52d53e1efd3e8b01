"""Plays a league's pairs and makes its trainings on a cluster, all at once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from rich.console import Console

from posse_baselines import load, load_target
from posse_training.cluster.collect import Backend, collect
from posse_training.cluster.evaluation import evaluation_job, sent
from posse_training.cluster.progress import ClusterProgress
from posse_training.cluster.settings import Cluster
from posse_training.cluster.shards import Job, joined
from posse_training.cluster.store import Folder
from posse_training.league.settings import LeagueSettings
from posse_training.league.work import Pair, Work
from posse_training.reports.results import Results
from posse_training.runs.seeds.on_cluster import train_on_cluster
from posse_training.runs.settings import TrainSettings


class ClusterWork(Work):
    """Does on a cluster what its base class does here, with the same result.

    A training that others wait for is made here, with all cores, from its checkpoints.

    Args:
        settings: Of the league.
        console: Where to show progress.
        cluster: The cluster's settings.
        backend: Its workers.
    """

    def __init__(self, settings: LeagueSettings, console: Console, cluster: Cluster, backend: Backend) -> None:
        super().__init__(settings, console)
        self._cluster, self._backend = cluster, backend
        self._store = Folder(cluster.work)

    def play(self, pairs: Sequence[Pair], episodes: int, seed: int, split: str) -> Iterator[Results]:
        """See :class:`~posse_training.league.work.Work`.

        Raises:
            ClusterError: The workers of one shard died again and again.
            PlayError: A policy failed.
        """
        jobs = [self._job(pair, episodes, seed, split) for pair in pairs]
        if not jobs:
            return
        with ClusterProgress("league", console=self.console) as watcher:
            failed = collect(jobs, self._backend, self._store, watcher, self._cluster.attempts)
        for (team, target), job in zip(pairs, jobs, strict=True):
            if job in failed:
                raise failed[job]
            columns = joined(self._store.read(job))
            yield Results(team.label, job.arguments[1], seed, split, columns, target.label)
            self._store.remove(job)  # by now they are kept elsewhere

    def train(self, runs: Mapping[str, TrainSettings]) -> None:
        """See :class:`~posse_training.league.work.Work`."""
        if len(runs) < 2:
            super().train(runs)
            return
        failed = train_on_cluster(runs, self._backend, self._cluster.attempts, console=self.console)
        for error in failed.values():
            raise error

    def _job(self, pair: Pair, episodes: int, seed: int, split: str) -> Job:
        team, target = pair
        policy, opponent = load(team.policy), load_target(target.policy)
        scenario = opponent.fit(self.scenario)
        return evaluation_job(
            sent(team.policy, policy),
            f"{team.label} against {target.label}",
            scenario.replace(message_size=max(scenario.message_size, policy.message_size)),
            episodes,
            seed,
            split,
            self._cluster,
            None,
            opponent,
        )
