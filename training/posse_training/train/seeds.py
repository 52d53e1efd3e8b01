"""The same training with several seeds: in turn here, or at once on a Ray cluster.

On a cluster each run is one task, which writes to its run folder on a file system that all nodes share: a run whose
worker died is resumed from its checkpoint by another one.
"""

from __future__ import annotations

import contextlib
import platform
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from posse_training.errors import ClusterError, SettingsError
from posse_training.files import check_held
from posse_training.parallel import connected, on_ray
from posse_training.train.settings import FREE, SETTINGS, TrainSettings
from posse_training.train.train import check_before, train


def with_seeds(settings: TrainSettings, seeds: Sequence[int]) -> list[TrainSettings]:
    """Return the settings with each seed; a folder that is given holds a subfolder for each of several.

    Raises:
        SettingsError: No seed, one out of its range, or one twice.
    """
    if len(set(seeds)) < max(1, len(seeds)):
        raise SettingsError(f"seed={' '.join(map(str, seeds))} names none, or one twice")
    folder = settings.folder if len(seeds) > 1 else None
    runs = [replace(settings, seed=seed) for seed in seeds]
    return runs if folder is None else [replace(run, folder=folder / f"seed-{run.seed}") for run in runs]


def train_seeds(runs: Sequence[TrainSettings], ray: bool | str) -> Iterator[Path]:
    """Train every run, or resume it where its folder holds it; yield the best policies' files.

    Raises:
        RunFolderError: A folder holds a run with other settings.
        ClusterError: There is no such cluster, or a node does not share the file system.
        Exception: As :func:`posse_training.train.train.train`; on a cluster when all runs have ended.
    """
    for settings in runs:
        check_before(settings)
        check_held(settings.run_folder / SETTINGS, settings.to_dict(), FREE)
    if ray is False:
        for settings in runs:
            yield train(settings)
        return
    with connected(ray, log=True):
        results = dict(on_ray(train_on_worker, [(settings, Path.cwd()) for settings in runs]))
    for k in range(len(runs)):
        if isinstance(results[k], Exception):
            raise results[k]
        yield results[k]


def train_on_worker(settings: TrainSettings, where: Path) -> Path:
    """Train on a worker as in the folder ``where``, on one thread; return the best policy's file.

    Raises:
        ClusterError: The node has no such folder.
    """
    if not where.is_dir():
        raise ClusterError(f"node {platform.node()} has no folder {where}: train on a file system that all nodes share")
    with contextlib.chdir(where):
        console = Console(width=100)
        console.print(f"seed {settings.seed}: {settings.run_folder}", markup=False)
        return train(settings, console=console, num_threads=1)
