"""Checkpoints: one safetensors file of arrays and JSON, protected by a digest.

Reading one never runs code. A new checkpoint replaces the last one atomically, so that a whole one
exists whenever the process is killed.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from posse_baselines.files import write_atomically
from posse_training.errors import CheckpointError

Arrays = dict[str, npt.NDArray[Any]]

CHECKPOINT: Final = "checkpoint.safetensors"
_FORMAT: Final = "posse-checkpoint-1"


def write_checkpoint(folder: Path, arrays: Arrays, state: Mapping[str, Any]) -> None:
    """Write a checkpoint: arrays by name, and plain values.

    Raises:
        CheckpointError: It could not be written; the last one is unchanged.
    """
    text = json.dumps(state)
    packed = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
    metadata = {"format": _FORMAT, "state": text, "digest": _digest(packed, text)}
    path = folder / CHECKPOINT
    try:
        write_atomically(path, save(packed, metadata))
    except OSError as error:
        kept = "the last one is kept" if path.is_file() else "there is no earlier one"
        raise CheckpointError(
            f"cannot write checkpoint {path}: {error.strerror or error}; {kept}. Make room, then "
            f"resume with: posse train --resume {folder}"
        ) from error


def read_checkpoint(folder: Path) -> tuple[Arrays, dict[str, Any]]:
    """Return the arrays and the plain values of a folder's checkpoint.

    Raises:
        CheckpointError: There is none, or it is damaged.
    """
    path = folder / CHECKPOINT
    if not path.is_file():
        raise CheckpointError(f"{folder} has no {CHECKPOINT}: start the training again")
    try:
        with safe_open(path, framework="numpy") as file:
            arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
            metadata = file.metadata() or {}
        text = metadata["state"]
        if metadata["format"] != _FORMAT:
            raise CheckpointError(f"the format of {path} is {metadata['format']!r:.80}, this version reads {_FORMAT!r}")
        whole = metadata["digest"] == _digest(arrays, text)
        state = json.loads(text)
    except (SafetensorError, OSError, KeyError, TypeError, ValueError, RecursionError) as error:
        raise _damaged(path, f"{error!s:.200}") from error
    if not whole:
        raise _damaged(path, "its digest does not match its contents")
    return arrays, state


def _damaged(path: Path, why: str) -> CheckpointError:
    return CheckpointError(
        f"checkpoint {path} is damaged: {why}. The run cannot be resumed from it; the policies in "
        "the folder are separate files"
    )


def _digest(arrays: Arrays, text: str) -> str:
    digest = hashlib.sha256(text.encode())
    for name in sorted(arrays):
        digest.update(f"{name} {arrays[name].dtype} {arrays[name].shape}".encode())
        digest.update(np.ascontiguousarray(arrays[name]).data)
    return digest.hexdigest()
