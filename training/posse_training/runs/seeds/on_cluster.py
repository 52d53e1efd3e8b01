"""Trainings on a cluster, one task each: files of a run folder go out and come back."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from posse_training.cluster.collect import Backend, collect
from posse_training.cluster.progress import ClusterProgress
from posse_training.cluster.shards import Arrays, Job, Shard
from posse_training.errors import CheckpointError
from posse_training.runs.saved.files import named_files, read_files, write_files
from posse_training.runs.saved.folder import locked_run
from posse_training.runs.seeds.on_worker import train_on_worker
from posse_training.runs.settings import TrainSettings


def train_on_cluster(
    runs: Mapping[str, TrainSettings], backend: Backend, attempts: int, *, console: Console | None = None
) -> dict[str, Exception]:
    """Train every run, or resume it where its folder holds it; return those that failed.

    What a run's folder holds, and the policy files that its settings name, are sent to the worker;
    what the worker's folder holds comes back when the run is finished.

    Args:
        runs: Settings by label.
        backend: The workers.
        attempts: How many of them may die with one run.
        console: Where to show progress.

    Raises:
        RunFolderError: A folder is in use.
        CheckpointError: A folder cannot be written to.
    """
    with contextlib.ExitStack() as stack:
        for settings in runs.values():
            stack.enter_context(locked_run(settings.run_folder))
        watcher = stack.enter_context(ClusterProgress("training", console=console))
        jobs = {
            Job(
                f"training {label}",
                train_on_worker,
                (label, replace(settings, folder=None), read_files(settings.run_folder), named_files(settings)),
                (Shard(settings.seed, 1),),
            ): label
            for label, settings in runs.items()
        }
        store = _RunFolders({job: runs[label].run_folder for job, label in jobs.items()})
        failed = collect(list(jobs), backend, store, watcher, attempts)
    return {jobs[job]: error for job, error in failed.items()}


class _RunFolders:
    """Run folders as a store: a run that is there is resumed, which ends at once if it is over."""

    def __init__(self, folders: dict[Job, Path]) -> None:
        self._folders = folders

    def missing(self, job: Job) -> list[Shard]:
        return list(job.shards)

    def write(self, job: Job, shard: Shard, arrays: Arrays) -> None:
        try:
            write_files(self._folders[job], arrays)
        except OSError as error:
            raise CheckpointError(
                f"cannot write {error.filename}: {error.strerror or error}. Make room, then run "
                "the same command again: it resumes"
            ) from error

    def read(self, job: Job) -> list[Arrays]:
        return [read_files(self._folders[job])]
