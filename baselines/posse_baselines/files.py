"""Files are written as a whole, where they are named and nowhere else."""

import contextlib
import json
import secrets
from collections.abc import Iterator
from pathlib import Path
from typing import Any

_PREFIX = ".posse-"


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file such that at any moment either the old or the whole new one exists; errors as :func:`replacing`."""
    with replacing(path) as partial:
        partial.write_bytes(content)


def write_json(path: Path, value: Any, *, indent: int | None = 2) -> None:
    """Write a value as JSON, as :func:`write_atomically` does."""
    write_atomically(path, (json.dumps(value, indent=indent) + "\n").encode())


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give the name of a file beside ``path`` to write to, which replaces ``path`` at the end.

    No other writer has that name; it has the suffix of ``path``. An OSError, for example of a full disk, changes
    nothing, and its ``filename`` is ``path``.
    """
    partial = path.with_name(f"{_PREFIX}{secrets.token_hex(8)}{path.suffix}")
    try:
        try:
            yield partial
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)
    except OSError as error:
        if error.errno is not None:
            error.filename = str(path)
            del error.filename2  # else a rename's, or None, is printed, too
        raise


def remove_unfinished(folder: Path) -> None:
    """Remove the files that :func:`replacing` left in a folder when its process was killed."""
    for path in folder.glob(f"{_PREFIX}{'[0-9a-f]' * 16}*"):
        path.unlink(missing_ok=True)


def read_json(path: Path) -> Any:
    """Return the content of a JSON file; ValueError if it holds none."""
    return json.loads(path.read_text(encoding="utf-8"))
