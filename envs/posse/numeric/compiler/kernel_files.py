"""Files that keep compiled kernels, one each, in a directory that only the user can write to.

A file is code: it is unpickled and run. So nothing is read from a directory that somebody else
could have written to, and a file is used only if it is whole, by a hash that it begins with.
Whatever is wrong with a directory or a file, the kernel is compiled again.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import stat
import sys
import tempfile
import time
from pathlib import Path
from typing import Final

_MAGIC: Final = b"posse kernel, format 1\n"
_HASH: Final = 32  # bytes of SHA-256
_SUFFIX: Final = ".kernel"
_UNFINISHED: Final = ".tmp"
_KEPT: Final = 256
"""Files that are kept, the last used; a kernel takes up to about a megabyte."""
_HOUR: Final = 3600.0


def cache_directory() -> Path | None:
    """Where kernels are kept, or None where there is not even a home directory."""
    chosen = os.environ.get("POSSE_CACHE_DIR")
    if chosen:
        return Path(chosen).absolute()
    user_cache = os.environ.get("XDG_CACHE_HOME")
    if user_cache:
        return Path(user_cache).absolute() / "posse"
    try:
        return Path.home() / ".cache" / "posse"
    except RuntimeError:
        return None


def read(name: str) -> bytes | None:
    """Return what was written under a name, or None if it is not there, whole and trusted."""
    directory = _open_directory()
    if isinstance(directory, str):
        return None
    path = directory / f"{name}{_SUFFIX}"
    try:
        with os.fdopen(_open_regular(path), "rb") as file:
            content = file.read()
    except (OSError, MemoryError):
        return None
    start = len(_MAGIC) + _HASH
    if content[:start] != _MAGIC + _hash(name, content[start:]):
        return None
    with contextlib.suppress(OSError):
        os.utime(path)  # it is in use: to be kept longer
    return content[start:]


def write(name: str, content: bytes) -> None:
    """Keep something under a name, if there is room and a directory to trust."""
    directory = _open_directory()
    if isinstance(directory, str):
        return
    unfinished = None
    try:
        handle, unfinished = tempfile.mkstemp(_UNFINISHED, dir=directory)  # mode 0600
        with os.fdopen(handle, "wb") as file:
            file.write(_MAGIC + _hash(name, content) + content)
        Path(unfinished).replace(directory / f"{name}{_SUFFIX}")
        _prune(directory)
    except OSError:
        if unfinished is not None:
            Path(unfinished).unlink(missing_ok=True)


@functools.cache  # once a process, however many kernels it compiles
def announce() -> None:
    """Say that the user has to wait, and whether only this time."""
    directory = _open_directory()
    if isinstance(directory, str):
        kept = f"each time: {directory}"
    elif os.access(directory, os.W_OK):
        kept = f"once; kept in {directory}"
    else:
        kept = f"each time: cannot write to {directory}"
    sys.stderr.write(f"posse: compiling kernels, which takes some seconds ({kept})\n")


def _hash(name: str, content: bytes) -> bytes:
    return hashlib.sha256(name.encode() + b"\n" + content).digest()


def _open_directory() -> Path | str:
    """Return the directory, made if it was not there, or why it cannot be used and what to do."""
    directory = cache_directory()
    if directory is None:
        return "there is no home directory; set POSSE_CACHE_DIR"
    try:
        directory.mkdir(mode=0o700, parents=True, exist_ok=True)
        fault = _distrust(directory.stat())
    except OSError as error:
        return f"cannot write to {directory} ({error.strerror}); set POSSE_CACHE_DIR"
    if fault is not None:
        return f"{directory} is not used, since {fault}"
    return directory


def _distrust(status: os.stat_result) -> str | None:
    """Return why somebody else could have written to a file or a directory, and what to do."""
    if not hasattr(os, "getuid"):  # Windows: whoever may write to the user's profile is the user
        return None
    if status.st_uid != os.getuid():
        return "it belongs to another user; set POSSE_CACHE_DIR to a directory of your own"
    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return "others can write to it; delete it, or `chmod go-w` it if you trust what is in it"
    return None


def _open_regular(path: Path) -> int:
    """Open a file to read, but nothing that could block or that others could have written."""
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_BINARY", 0) | getattr(os, "O_NONBLOCK", 0))
    status = os.fstat(handle)
    if not stat.S_ISREG(status.st_mode) or _distrust(status):
        os.close(handle)
        raise PermissionError(str(path))
    return handle


def _prune(directory: Path) -> None:
    """Drop what has not been used for longest, and what a process that was killed left behind."""
    files = sorted(directory.glob(f"*{_SUFFIX}"), key=lambda path: path.stat().st_mtime)
    left = [
        path
        for path in directory.glob(f"*{_UNFINISHED}")
        if path.stat().st_mtime < time.time() - _HOUR
    ]
    for path in files[:-_KEPT] + left:
        path.unlink(missing_ok=True)
