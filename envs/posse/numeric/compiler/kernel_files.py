"""Compiled kernels on disk, one file each, in a directory that only the user can write to.

A file is unpickled and executed. Therefore files in a directory that another user could have
written to are not read, and each file begins with a hash of its contents, which is verified. If a
directory or file cannot be used, the kernel is compiled.
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
"""Maximum number of files; the least recently used are deleted. A kernel takes up to 1 MB."""
_HOUR: Final = 3600.0


def cache_directory() -> Path | None:
    """Return the directory of the kernels, or None without a home directory."""
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
    """Return what was written under a name, or None if it is missing, damaged or not trusted."""
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
        os.utime(path)  # mark as recently used
    return content[start:]


def write(name: str, content: bytes) -> None:
    """Store content under a name; do nothing if the directory cannot be used or is full."""
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


@functools.cache  # once per process
def announce() -> None:
    """Print that kernels are being compiled, and whether the result is kept."""
    directory = _open_directory()
    if isinstance(directory, str):
        kept = f"in each process: {directory}"
    elif os.access(directory, os.W_OK):
        kept = f"once; cached in {directory}"
    else:
        kept = f"in each process: cannot write to {directory}"
    sys.stderr.write(f"posse: compiling kernels, which takes some seconds ({kept})\n")


def _hash(name: str, content: bytes) -> bytes:
    return hashlib.sha256(name.encode() + b"\n" + content).digest()


def _open_directory() -> Path | str:
    """Return the directory, created if missing, or the reason why it cannot be used and the fix."""
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
    """Return why another user could have written to a file or directory, and the fix, or None."""
    if not hasattr(os, "getuid"):  # Windows protects the user's profile by itself
        return None
    if status.st_uid != os.getuid():
        return "it belongs to another user; set POSSE_CACHE_DIR to a directory of your own"
    if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return "others can write to it; delete it, or `chmod go-w` it if you trust what is in it"
    return None


def _open_regular(path: Path) -> int:
    """Open a regular file for reading, if no other user could have written it."""
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_BINARY", 0) | getattr(os, "O_NONBLOCK", 0))
    status = os.fstat(handle)
    if not stat.S_ISREG(status.st_mode) or _distrust(status):
        os.close(handle)
        raise PermissionError(str(path))
    return handle


def _prune(directory: Path) -> None:
    """Delete the least recently used kernels, and unfinished files of killed processes."""
    files = sorted(directory.glob(f"*{_SUFFIX}"), key=lambda path: path.stat().st_mtime)
    left = [path for path in directory.glob(f"*{_UNFINISHED}") if path.stat().st_mtime < time.time() - _HOUR]
    for path in files[:-_KEPT] + left:
        path.unlink(missing_ok=True)
