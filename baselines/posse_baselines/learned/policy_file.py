"""Policy files: one safetensors file of tensors and JSON, protected by a digest.

Reading one interprets numbers and JSON and never runs code.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, Any, Final

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from posse.numeric import FloatArray
from posse_baselines.policy import PolicyError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

_KEY: Final = "posse-policy"


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file such that at any moment either the old or the whole new one exists.

    The new file has the permissions that any new file has (the umask). Processes that write the
    same file at once take turns; the last one's content stays.

    Raises:
        OSError: It could not be written, for example because the disk is full; the old file is
            unchanged. Its ``filename`` is ``path``.
    """
    partial = path.with_name(f".{path.name}.partial")
    try:
        with _held(partial) as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
            if fcntl is not None:
                partial.replace(path)  # while it is held: afterwards it may be somebody else's
        if fcntl is None:
            partial.replace(path)  # Windows does not rename an open file
    except OSError as error:
        error.filename, error.filename2 = str(path), None
        raise


@contextlib.contextmanager
def _held(partial: Path) -> Iterator[IO[bytes]]:
    """Open an unfinished file, empty, once no other process writes it; drop it on an error."""
    while True:
        with partial.open("ab") as file:
            if fcntl is not None:
                with contextlib.suppress(OSError):  # file systems without locks
                    fcntl.flock(file, fcntl.LOCK_EX)  # until it is closed
                if not _is_at(file, partial):
                    continue  # whoever held it has renamed it
            try:
                file.truncate(0)  # what a killed process left
                yield file
            except BaseException:
                with contextlib.suppress(OSError):
                    partial.unlink()
                raise
            return


def _is_at(file: IO[bytes], path: Path) -> bool:
    """Return whether an open file still has this path."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except OSError:
        return False


def write_policy_file(path: Path, tensors: Mapping[str, FloatArray], description: Mapping[str, Any]) -> None:
    """Write a policy file, replacing one of that name.

    Raises:
        OSError: It could not be written; the old file is unchanged.
    """
    text = json.dumps(description, sort_keys=True)
    metadata = {_KEY: text, "digest": _digest(tensors, text)}
    write_atomically(path, save(dict(tensors), metadata))


def read_policy_file(path: Path) -> tuple[dict[str, FloatArray], Any]:
    """Return the tensors and the description of a policy file.

    Raises:
        PolicyError: There is no such file, or it is damaged, truncated, or not a policy file.
    """
    if not path.is_file():
        raise PolicyError(f"there is no policy file {path}")
    try:
        with safe_open(path, framework="numpy") as file:
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
            metadata = file.metadata() or {}
    except (SafetensorError, OSError, TypeError, ValueError) as error:
        raise PolicyError(f"{path} is damaged, truncated, or not a policy file: {error!s:.200}") from error
    text = metadata.get(_KEY)
    if text is None:
        raise PolicyError(f"{path} is a safetensors file, but holds no policy of posse")
    if metadata.get("digest") != _digest(tensors, text):
        raise PolicyError(f"{path} is damaged: its digest does not match its contents")
    try:
        return tensors, json.loads(text)
    except RecursionError:
        raise PolicyError(f"{path} is damaged: its description is nested too deeply") from None
    except ValueError as error:
        raise PolicyError(f"{path} is damaged: {error}") from error


def _digest(tensors: Mapping[str, FloatArray], text: str) -> str:
    """Return a hash over all that a file says."""
    digest = hashlib.sha256(text.encode())
    for name in sorted(tensors):
        digest.update(f"{name} {tensors[name].dtype} {tensors[name].shape}".encode())
        digest.update(np.ascontiguousarray(tensors[name]).tobytes())
    return digest.hexdigest()
