"""Work that is cut into shards by the index of its worlds, whatever the number of workers."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Arrays = dict[str, npt.NDArray[Any]]
"""Results of a shard, by name."""


@dataclass(frozen=True, order=True)
class Shard:
    """Worlds ``first`` to ``first + count - 1``."""

    first: int
    count: int


def cut(count: int, size: int, first: int = 0) -> tuple[Shard, ...]:
    """Return the shards of ``count`` worlds from ``first`` on, of ``size`` worlds at most."""
    return tuple(Shard(first + begin, min(size, count - begin)) for begin in range(0, count, size))


@dataclass(frozen=True, eq=False)
class Job:
    """Work whose shards can be done anywhere, in any order.

    Attributes:
        name: Name in messages.
        function: Of a module; ``function(*arguments, shard)`` returns the shard's arrays.
        arguments: Can be pickled.
        shards: The shards.
        identity: All that the arrays depend on beside the shard, as values for JSON.
    """

    name: str
    function: Callable[..., Arrays]
    arguments: tuple[Any, ...]
    shards: tuple[Shard, ...]
    identity: Any = None

    @property
    def key(self) -> str:
        """A file name that jobs share if and only if their arrays are the same."""
        text = json.dumps(self.identity, sort_keys=True)
        digest = hashlib.sha256(text.encode()).hexdigest()[:16]
        return f"{re.sub(r'[^A-Za-z0-9._-]+', '_', self.name)[:80].lstrip('.')}-{digest}"


def joined(parts: list[Arrays]) -> Arrays:
    """Return arrays whose first axis runs over the worlds of all parts."""
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
