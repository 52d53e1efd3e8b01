"""A run folder's files, and those that settings name, as arrays that are sent to a worker."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from posse_baselines.files import write_atomically
from posse_baselines.registry import is_file
from posse_training.files import LOCK
from posse_training.parallel import Arrays
from posse_training.runs.saved.checkpoint import CHECKPOINT
from posse_training.runs.settings import TrainSettings, opponents_of


def read_files(folder: Path) -> Arrays:
    """Return the contents of the files of a run folder, uint8, by their names in it."""
    return {
        path.relative_to(folder).as_posix(): np.frombuffer(path.read_bytes(), np.uint8)
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != LOCK
    }


def named_files(settings: TrainSettings) -> Arrays:
    """Return the files that a training's settings name, uint8, by the name that they have there.

    They are policies, and the checkpoint of the run that it begins with.
    """
    named = [settings.advise, settings.imitate, settings.beside, *opponents_of(settings.against)]
    if settings.start is not None:
        named.append(str(Path(settings.start) / CHECKPOINT))
    return {
        name: np.frombuffer(Path(name).read_bytes(), np.uint8) for name in named if name is not None and is_file(name)
    }


def write_files(folder: Path, files: Arrays) -> None:
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
