"""Results of shards on disk: one file each, written as a whole or not at all."""

from __future__ import annotations

import contextlib
import io
import shutil
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

import numpy as np

from posse_baselines.files import write_atomically
from posse_training.cluster.shards import Arrays, Job, Shard
from posse_training.errors import ClusterError
from posse_training.files import InUseError, locked


class Store(Protocol):
    """Where the results of shards are kept."""

    def missing(self, job: Job) -> list[Shard]:
        """Return the shards that have no results yet."""
        ...

    def write(self, job: Job, shard: Shard, arrays: Arrays) -> None:
        """Keep the results of a shard."""
        ...

    def read(self, job: Job) -> list[Arrays]:
        """Return the results of all shards, in their order."""
        ...


class Memory:
    """Results in memory, for work that needs no resuming."""

    def __init__(self) -> None:
        self._kept: dict[tuple[Job, Shard], Arrays] = {}

    def missing(self, job: Job) -> list[Shard]:
        """See :class:`Store`."""
        return [shard for shard in job.shards if (job, shard) not in self._kept]

    def write(self, job: Job, shard: Shard, arrays: Arrays) -> None:
        """See :class:`Store`."""
        self._kept[job, shard] = arrays

    def read(self, job: Job) -> list[Arrays]:
        """See :class:`Store`."""
        return [self._kept[job, shard] for shard in job.shards]


class Folder:
    """Results in a folder, a subfolder for each job: those of a killed driver are found again.

    Args:
        folder: The folder, made when something is written.
    """

    def __init__(self, folder: str | Path) -> None:
        self._folder = Path(folder)

    @contextlib.contextmanager
    def held(self, job: Job) -> Iterator[None]:
        """Hold a job's subfolder: no other process can collect the same meanwhile.

        Raises:
            ClusterError: Another one does, or the folder cannot be written to.
        """
        with contextlib.ExitStack() as stack:
            try:
                stack.enter_context(locked(self._folder / job.key))
            except InUseError as error:
                raise ClusterError(
                    f"process {error.holder} collects {job.name} in {self._folder}: wait for it"
                ) from error
            except OSError as error:
                raise self._cannot_write(error) from error
            yield

    def missing(self, job: Job) -> list[Shard]:
        """See :class:`Store`."""
        return [shard for shard in job.shards if self._load(job, shard) is None]

    def write(self, job: Job, shard: Shard, arrays: Arrays) -> None:
        """See :class:`Store`.

        Raises:
            ClusterError: The disk is full, or the folder cannot be written to.
        """
        content = io.BytesIO()
        np.savez(content, allow_pickle=False, **arrays)
        path = self._path(job, shard)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(path, content.getvalue())
        except OSError as error:
            raise self._cannot_write(error) from error

    def read(self, job: Job) -> list[Arrays]:
        """See :class:`Store`."""
        return list(self.iterate(job))

    def iterate(self, job: Job) -> Iterator[Arrays]:
        """Yield the results of all shards in their order, one at a time.

        Raises:
            ClusterError: One is missing or damaged.
        """
        for shard in job.shards:
            arrays = self._load(job, shard)
            if arrays is None:
                path = self._path(job, shard)
                raise ClusterError(f"{path} is missing or damaged: run the same again")
            yield arrays

    def remove(self, job: Job) -> None:
        """Remove the results of a job, and the folder with the last one."""
        shutil.rmtree(self._folder / job.key, ignore_errors=True)
        with contextlib.suppress(OSError):  # others are in it
            self._folder.rmdir()

    def clear(self) -> None:
        """Remove the folder, if nothing but results of shards is in it."""
        if self._folder.is_dir():
            for path in self._folder.iterdir():
                if path.is_dir() and all(p.suffix == ".npz" for p in path.iterdir()):
                    shutil.rmtree(path)
            with contextlib.suppress(OSError):  # others are in it
                self._folder.rmdir()

    def _path(self, job: Job, shard: Shard) -> Path:
        return self._folder / job.key / f"{shard.first}-{shard.count}.npz"

    def _load(self, job: Job, shard: Shard) -> Arrays | None:
        """Return the results of a shard; ``None``: there are none, or they are damaged."""
        try:
            content = io.BytesIO(self._path(job, shard).read_bytes())
            with np.load(content, allow_pickle=False) as file:
                return {name: file[name] for name in file.files}
        except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile):
            return None

    def _cannot_write(self, error: OSError) -> ClusterError:
        return ClusterError(
            f"cannot write to {self._folder}: {error.strerror or error}. Make room, then run the same again: it resumes"
        )
