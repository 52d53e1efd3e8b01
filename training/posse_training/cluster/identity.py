"""What results depend on beside their settings: sources, versions, and the policy."""

from __future__ import annotations

import functools
import hashlib
import importlib
import importlib.util
import platform
from pathlib import Path
from typing import Any, Final

import cloudpickle
import llvmlite
import numba
import numpy as np

from posse import TargetPolicy
from posse_baselines import Policy, Target
from posse_baselines.playing import Match

_PACKAGES: Final = ("posse", "posse_baselines", "posse_training")
_SUFFIXES: Final = (".py", ".json", ".safetensors", ".toml")


@functools.cache
def installed() -> str:
    """Return the versions that the numbers of an episode depend on, and a digest of the sources."""
    digest = hashlib.sha256()
    for name in _PACKAGES:
        root = Path(importlib.import_module(name).__file__ or "").parent
        for path in sorted(p for p in root.rglob("*") if p.suffix in _SUFFIXES):
            digest.update(f"{name}/{path.relative_to(root).as_posix()}\0".encode())
            digest.update(hashlib.sha256(path.read_bytes()).digest())
    version = importlib.import_module("posse").__version__
    return (
        f"posse {version} (sources {digest.hexdigest()[:12]}), Python "
        f"{platform.python_version()}, numpy {np.__version__}, numba {numba.__version__}, "
        f"llvmlite {llvmlite.__version__}"
    )


def policy_identity(policy: str | Policy | Target | TargetPolicy) -> Any:
    """Return what a policy's actions depend on: its name or contents, and its module's source."""
    if isinstance(policy, str):
        module, sign, _ = policy.partition(":")
        return [policy, _source(module) if sign else ""]
    if isinstance(policy, Match):
        return [policy_identity(policy.policy), policy_identity(policy.target)]
    if isinstance(policy, Target):
        moves = None if policy.policy is None else policy_identity(policy.policy)
        return [policy.name, policy.motion, moves]
    return [_digest(cloudpickle.dumps(policy)), _source(type(policy).__module__)]


def _source(module: str) -> str:
    """Return a digest of a module's file; empty: it has none."""
    try:
        spec = importlib.util.find_spec(module)
    except (ImportError, ValueError):  # ValueError: __main__
        return ""
    path = Path(spec.origin) if spec and spec.origin else None
    return _digest(path.read_bytes()) if path and path.is_file() else ""


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
