"""A training run on a worker of a cluster: files in, files out."""

from __future__ import annotations

import io
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from posse_training.cluster.shards import Arrays, Shard
from posse_training.runs.files import read_files, write_files
from posse_training.runs.folder import SETTINGS
from posse_training.runs.settings import TrainSettings
from posse_training.runs.train import train


def train_on_worker(settings: TrainSettings, files: Arrays, shard: Shard) -> Arrays:
    """Train, or resume what the files of a run folder hold; return its files when finished.

    Args:
        settings: All that the result depends on.
        files: Contents of the run folder's files, uint8, by name; none: the run is new.
        shard: Not used: the run is one shard.
    """
    with tempfile.TemporaryDirectory(prefix="posse-train-") as place:
        folder = Path(place) / "run"
        write_files(folder, files)
        console = Console(file=_Prefixed(f"seed {settings.seed}: "), width=100)
        train(
            replace(settings, folder=folder), console=console, num_threads=1,
            resume=(folder / SETTINGS).exists(),
        )  # fmt: skip
        return read_files(folder)


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
