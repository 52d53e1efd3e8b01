"""The same training with several seeds: in turn here, or at once on a cluster."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from posse_training.cluster.collect import collect
from posse_training.cluster.progress import ClusterProgress
from posse_training.cluster.settings import Cluster
from posse_training.cluster.shards import Arrays, Job, Shard
from posse_training.errors import CheckpointError, RunFolderError, SettingsError
from posse_training.runs.files import read_files, write_files
from posse_training.runs.folder import BEST, LAST, SETTINGS, locked_run
from posse_training.runs.on_worker import train_on_worker
from posse_training.runs.settings import TrainSettings
from posse_training.runs.train import check_before, train


def with_seeds(settings: TrainSettings, seeds: Sequence[int]) -> list[TrainSettings]:
    """Return the settings with each seed; a folder that is given holds a subfolder for each.

    Raises:
        SettingsError: A seed out of its range, or one twice.
    """
    if len(set(seeds)) < len(seeds):
        raise SettingsError(f"seeds={' '.join(map(str, seeds))} names one twice: leave it out")
    return [
        replace(
            settings,
            seed=seed,
            folder=None if settings.folder is None else settings.folder / f"seed-{seed}",
        )
        for seed in seeds
    ]


def train_seeds(runs: Sequence[TrainSettings], cluster: Cluster | None) -> Iterator[Path]:
    """Train every run, or resume it where its folder holds it; yield the best policies' files.

    On a cluster each run is one task; what its folder holds is sent to the worker, and what the
    worker's holds comes back when the run is finished.

    Raises:
        RunFolderError: A folder is in use, or holds a run with other settings.
        ClusterError: There is no such cluster, or the workers of one run died again and again.
        Exception: As :func:`posse_training.runs.train.train`.
    """
    for settings in runs:
        check_before(settings)
        _check_folder(settings)
    if cluster is None:
        for settings in runs:
            yield train(settings, resume=(settings.run_folder / SETTINGS).exists())
        return
    from posse_training.cluster.ray_backend import RayBackend

    with contextlib.ExitStack() as stack:
        backend = stack.enter_context(RayBackend(cluster, log=True))
        for settings in runs:
            stack.enter_context(locked_run(settings.run_folder))
        watcher = stack.enter_context(ClusterProgress("training"))
        jobs = {
            Job(
                f"training with seed {settings.seed}",
                train_on_worker,
                (replace(settings, folder=None), read_files(settings.run_folder)),
                (Shard(settings.seed, 1),),
            ): settings.run_folder
            for settings in runs
        }
        failed = collect(list(jobs), backend, _RunFolders(jobs), watcher, cluster.attempts)
    for job, folder in jobs.items():
        if job in failed:
            raise failed[job]
        yield folder / (BEST if (folder / BEST).is_file() else LAST)


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


def _check_folder(settings: TrainSettings) -> None:
    """Raise if a run folder holds a run with other settings."""
    folder = settings.run_folder
    path = folder / SETTINGS
    wanted = json.loads(json.dumps({**settings.to_dict(), "folder": None}))
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return
    except (OSError, ValueError, RecursionError) as error:
        raise RunFolderError(f"{path} is damaged: {error}") from error
    if found != wanted:
        other = next(
            (n for n in wanted if not isinstance(found, dict) or found.get(n) != wanted[n]), "?"
        )
        raise RunFolderError(
            f"{folder} holds a run with another {other}: remove it, or choose another --folder"
        )
