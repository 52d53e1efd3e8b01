"""Policy files: one safetensors file of tensors and JSON, protected by a digest.

Reading one interprets numbers and JSON and never runs code.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from posse.numeric import FloatArray
from posse_baselines.files import write_atomically
from posse_baselines.policy import PolicyError

_KEY: Final = "posse-policy"


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
