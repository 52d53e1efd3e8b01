"""Files are written as a whole, where they are named and nowhere else."""

from __future__ import annotations

import contextlib
import errno
import json
import secrets
from collections.abc import Iterator
from pathlib import Path
from typing import Any

_PREFIX = ".posse-"


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file such that at any moment either the old or the whole new one exists.

    Raises:
        OSError: ``path`` is a symbolic link, or it could not be written, for example because the
            disk is full; nothing is changed. Its ``filename`` is ``path``.
    """
    with replacing(path) as partial, partial.open("r+b") as file:
        file.write(content)


def write_json(path: Path, value: Any, *, indent: int | None = 2) -> None:
    """Write a value as JSON, as :func:`write_atomically` does."""
    write_atomically(path, (json.dumps(value, indent=indent) + "\n").encode())


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a new, empty file beside ``path`` to write to, which replaces ``path`` at the end.

    It has a name of its own, so that several writers do not meet, and the suffix of ``path``.

    Raises:
        OSError: As in :func:`write_atomically`.
    """
    partial = path.with_name(f"{_PREFIX}{secrets.token_hex(8)}{path.suffix}")
    try:
        refuse_link(path)
        partial.touch(exist_ok=False)
        try:
            yield partial
            partial.replace(path)
        except BaseException:
            partial.unlink(missing_ok=True)
            raise
    except OSError as error:
        error.filename, error.filename2 = str(path), None
        raise


def remove_unfinished(folder: Path) -> None:
    """Remove the files that :func:`replacing` left in a folder when its process was killed."""
    for path in folder.glob(f"{_PREFIX}{'[0-9a-f]' * 16}*"):
        path.unlink(missing_ok=True)


def refuse_link(path: Path) -> None:
    """Raise if a path is a symbolic link, which could lead a write to another folder.

    Raises:
        OSError: It is.
    """
    if path.is_symlink():
        raise OSError(errno.ELOOP, "a symbolic link is not written to: remove it, or name another file", str(path))


def read_json(path: Path) -> Any:
    """Return the content of a JSON file.

    Raises:
        OSError: It cannot be read.
        ValueError: It holds no JSON, or values nested too deeply.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except RecursionError:
        raise ValueError("its values are nested too deeply") from None
