"""The same training with several seeds: in turn here, or at once on a cluster."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from posse_training.errors import RunFolderError, SettingsError
from posse_training.files import read_json
from posse_training.parallel import connected
from posse_training.runs.saved.folder import BEST, LAST, SETTINGS
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
        replace(settings, seed=seed, folder=None if settings.folder is None else settings.folder / f"seed-{seed}")
        for seed in seeds
    ]


def train_seeds(runs: Sequence[TrainSettings], ray: bool | str) -> Iterator[Path]:
    """Train every run, or resume it where its folder holds it; yield the best policies' files.

    On a cluster each run is one task.

    Raises:
        RunFolderError: A folder is in use, or holds a run with other settings.
        ClusterError: There is no such cluster, or the workers of one run died again and again.
        Exception: As :func:`posse_training.runs.train.train`.
    """
    for settings in runs:
        check_before(settings)
        _check_folder(settings)
    if ray is False:
        for settings in runs:
            yield train(settings, resume=(settings.run_folder / SETTINGS).exists())
        return
    from posse_training.runs.seeds.on_cluster import train_on_cluster

    labelled = {f"seed {settings.seed}": settings for settings in runs}
    with connected(ray, log=True):
        failed = train_on_cluster(labelled)
    for label, settings in labelled.items():
        if label in failed:
            raise failed[label]
        folder = settings.run_folder
        yield folder / (BEST if (folder / BEST).is_file() else LAST)


def _check_folder(settings: TrainSettings) -> None:
    """Raise if a run folder holds a run with other settings."""
    folder = settings.run_folder
    path = folder / SETTINGS
    wanted = json.loads(json.dumps({**settings.to_dict(), "folder": None}))
    try:
        found = read_json(path)
    except FileNotFoundError:
        return
    except (OSError, ValueError) as error:
        raise RunFolderError(f"{path} is damaged: {error}") from error
    if found != wanted:
        other = next((n for n in wanted if not isinstance(found, dict) or found.get(n) != wanted[n]), "?")
        raise RunFolderError(f"{folder} holds a run with another {other}: remove it, or choose another --folder")
