"""The files of a run folder as arrays, to be sent to a worker and back."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from posse_baselines.learned.policy_file import write_atomically
from posse_training.cluster.shards import Arrays
from posse_training.files import LOCK
from posse_training.runs.checkpoint import CHECKPOINT


def read_files(folder: Path) -> Arrays:
    """Return the contents of the files of a run folder, uint8, by their names in it."""
    return {
        path.relative_to(folder).as_posix(): np.frombuffer(path.read_bytes(), np.uint8)
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != LOCK
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
