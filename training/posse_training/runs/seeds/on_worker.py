"""A training run on a worker of a cluster: files in, files out."""

from __future__ import annotations

import contextlib
import io
import platform
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from posse_training.errors import ClusterError
from posse_training.parallel import Arrays
from posse_training.runs.saved.files import read_files, write_files
from posse_training.runs.saved.folder import SETTINGS
from posse_training.runs.settings import TrainSettings
from posse_training.runs.train import train


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
        write_files(work, {name: named[name] for name in named if _is_inside(name)})
        write_files(folder, files)
        console = Console(file=_Prefixed(f"{label}: "), width=100)
        with contextlib.chdir(work):  # where relative paths of the settings lead
            train(replace(settings, folder=folder), console=console, num_threads=1, resume=(folder / SETTINGS).exists())
        return read_files(folder)


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
