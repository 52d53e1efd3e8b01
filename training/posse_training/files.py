"""Folders that one process at a time may write to."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Final

from posse_baselines.files import read_json, refuse_link, remove_unfinished

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

__all__ = ["LOCK", "InUseError", "locked", "read_json"]

LOCK: Final = "lock"
"""Name of the lock file in a folder."""
_LOCK_FLAGS: Final = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)


class InUseError(RuntimeError):
    """A folder that another process holds.

    Attributes:
        holder: The process number, or "another process".
    """

    def __init__(self, folder: Path, holder: str) -> None:
        super().__init__(f"{folder} is in use by process {holder}")
        self.holder = holder


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a folder, made if missing: no other process can hold it meanwhile.

    The operating system releases the lock when the process ends, however it ends. Unfinished files
    of a process that was killed are removed. A folder that contains a symbolic link is refused,
    since what is written to it would land elsewhere.

    Raises:
        InUseError: Another process holds it.
        OSError: The folder cannot be written to, or contains a symbolic link; it names the file.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for inside in folder.iterdir():
        refuse_link(inside)
    path = folder / LOCK
    with os.fdopen(os.open(path, _LOCK_FLAGS, 0o666), "r+", encoding="utf-8") as file:
        _hold(file, folder)
        try:
            # Unbuffered, so that closing the file does not fail again on a full disk.
            os.truncate(file.fileno(), 0)
            os.write(file.fileno(), f"{os.getpid()}\n".encode())
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(path)) from error
        remove_unfinished(folder)
        yield


def _hold(file: IO[str], folder: Path) -> None:
    if fcntl is None:
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        file.seek(0)
        raise InUseError(folder, file.read().strip() or "another process") from error
