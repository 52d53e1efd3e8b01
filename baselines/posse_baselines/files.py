"""Files are written as a whole, where they are named and nowhere else."""

import contextlib
import json
import math
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
    """Write a value as JSON (:func:`to_json`), as :func:`write_atomically` does."""
    write_atomically(path, (json.dumps(to_json(value), indent=indent, allow_nan=False) + "\n").encode())


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
    """Return the content of a JSON file of :func:`write_json`; ValueError if it holds none."""
    return json.loads(path.read_text(encoding="utf-8"), object_hook=from_json)


def to_json(value: Any) -> Any:
    """Return a value for JSON, with ``{"number": "inf"}`` for an infinite number."""
    if isinstance(value, dict):
        return {name: to_json(part) for name, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [to_json(part) for part in value]
    return {"number": str(value)} if isinstance(value, float) and not math.isfinite(value) else value


def from_json(found: dict[str, Any]) -> Any:
    """Return an object that is read from JSON, or the number of :func:`to_json` that it stands for."""
    return float(found["number"]) if list(found) == ["number"] else found
