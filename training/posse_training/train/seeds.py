"""The same training with several seeds: in turn here, or at once on a Ray cluster.

On a cluster each run is one task: the files of its folder go to a worker and come back.
"""

from __future__ import annotations

import contextlib
import io
import json
import platform
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console

from posse_baselines.files import write_atomically
from posse_baselines.registry import is_file
from posse_training.errors import CheckpointError, ClusterError, RunFolderError, SettingsError
from posse_training.files import LOCK, read_json
from posse_training.parallel import Arrays, connected, on_ray
from posse_training.train.checkpoint import CHECKPOINT, locked_run
from posse_training.train.settings import SETTINGS, TrainSettings, best_policy, opponents_of
from posse_training.train.train import check_before, train


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
        Exception: As :func:`posse_training.train.train.train`.
    """
    for settings in runs:
        check_before(settings)
        _check_folder(settings)
    if ray is False:
        for settings in runs:
            yield train(settings, resume=(settings.run_folder / SETTINGS).exists())
        return
    labelled = {f"seed {settings.seed}": settings for settings in runs}
    with connected(ray, log=True):
        failed = _train_on_cluster(labelled)
    for label, settings in labelled.items():
        if label in failed:
            raise failed[label]
        yield best_policy(settings.run_folder)


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


def _train_on_cluster(runs: Mapping[str, TrainSettings]) -> dict[str, Exception]:
    """Train every run, or resume it where its folder holds it; return those that failed.

    What a run's folder holds, and the policy files that its settings name, are sent to the worker;
    what the worker's folder holds comes back when the run is finished.

    Args:
        runs: Settings by label.

    Raises:
        RunFolderError: A folder is in use.
        CheckpointError: A folder cannot be written to.
    """
    failed: dict[str, Exception] = {}
    with contextlib.ExitStack() as stack:
        for settings in runs.values():
            stack.enter_context(locked_run(settings.run_folder))
        calls = [
            (label, replace(settings, folder=None), _read_files(settings.run_folder), _named_files(settings))
            for label, settings in runs.items()
        ]
        for k, result in on_ray(train_on_worker, calls):
            label = calls[k][0]
            if isinstance(result, Exception):
                failed[label] = result
                continue
            try:
                _write_files(runs[label].run_folder, result)
            except OSError as error:
                raise CheckpointError(
                    f"cannot write {error.filename}: {error.strerror or error}. Make room, then run "
                    "the same command again: it resumes"
                ) from error
    return failed


def train_on_worker(label: str, settings: TrainSettings, files: Arrays, named: Arrays) -> Arrays:
    """Train, or resume what the files of a run folder hold; return its files when finished.

    Args:
        label: Stands before each line of output.
        settings: All that the result depends on.
        files: Contents of the run folder's files, uint8, by name; none: the run is new.
        named: Contents of the files that the settings name, uint8, by the name that they have
            there.

    Raises:
        ClusterError: A file with an absolute path is not on this node.
    """
    with tempfile.TemporaryDirectory(prefix="posse-train-") as place:
        folder = Path(place) / "run"
        work = Path(place) / "work"
        work.mkdir()
        _write_files(work, {name: named[name] for name in named if _is_inside(name)})
        _write_files(folder, files)
        console = Console(file=_Prefixed(f"{label}: "), width=100)
        with contextlib.chdir(work):  # where relative paths of the settings lead
            train(replace(settings, folder=folder), console=console, num_threads=1, resume=(folder / SETTINGS).exists())
        return _read_files(folder)


def _is_inside(name: str) -> bool:
    """Whether a name stays in the folder that it starts from; if not, the file must be here.

    Raises:
        ClusterError: It does not and is not.
    """
    path = Path(name)
    if not path.is_absolute() and ".." not in path.parts:
        return True
    if path.is_absolute() and path.is_file():
        return False
    raise ClusterError(
        f"node {platform.node()} has no {name}, which the training reads: name it by a path "
        "relative to the current folder and inside of it, then it is sent, or put it at the same "
        "path on all nodes"
    )


class _Prefixed(io.StringIO):
    """Standard output, each line with a prefix: the driver shows those of all workers."""

    def __init__(self, prefix: str) -> None:
        super().__init__()
        self._prefix = prefix

    def write(self, text: str) -> int:
        sys.stdout.writelines(f"{self._prefix}{line}\n" for line in text.splitlines() if line)
        return len(text)

    def flush(self) -> None:
        sys.stdout.flush()


def _read_files(folder: Path) -> Arrays:
    """Return the contents of the files of a run folder, uint8, by their names in it."""
    return {
        path.relative_to(folder).as_posix(): np.frombuffer(path.read_bytes(), np.uint8)
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != LOCK
    }


def _named_files(settings: TrainSettings) -> Arrays:
    """Return the files that a training's settings name, uint8, by the name that they have there.

    They are policies, and the checkpoint of the run that it begins with.
    """
    named = [settings.advise, settings.imitate, settings.beside, *opponents_of(settings.against)]
    if settings.start is not None:
        named.append(str(Path(settings.start) / CHECKPOINT))
    return {
        name: np.frombuffer(Path(name).read_bytes(), np.uint8) for name in named if name is not None and is_file(name)
    }


def _write_files(folder: Path, files: Arrays) -> None:
    """Write files to a run folder, each as a whole or not at all.

    The checkpoint comes last: until it is there, a run is resumed from the old one, with the same
    result.

    Raises:
        OSError: One could not be written.
    """
    for name in sorted(files, key=lambda name: name == CHECKPOINT):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, files[name].tobytes())
