"""Kernels over worlds, spread over threads; worlds know nothing of each other."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final

_SERIAL_BELOW: Final = 2048
"""Trackers below which waking another thread costs more than it saves."""

_PROCESSORS: Final = os.cpu_count() or 1

_pool: ThreadPoolExecutor | None = None
_process = -1


def most_parts() -> int:
    """Return into how many parts :func:`over_worlds` splits the worlds at most."""
    return _PROCESSORS


def over_worlds(
    kernel: Callable[..., None], arguments: tuple[Any, ...], num_worlds: int, num_trackers: int
) -> None:
    """Call ``kernel(*arguments, part, first, last)`` for parts that together are all worlds.

    Parts are numbered from 0 to at most :func:`most_parts` - 1, for kernels that need a place of
    their own to work in.
    """
    global _pool, _process
    threads = min(most_parts(), num_worlds)
    if threads == 1 or num_worlds * num_trackers < _SERIAL_BELOW:
        kernel(*arguments, 0, 0, num_worlds)
        return
    if _pool is None or _process != os.getpid():
        _pool = ThreadPoolExecutor(threads, "posse-policy")
        _process = os.getpid()  # threads do not survive a fork
    edges = [num_worlds * k // threads for k in range(threads + 1)]
    waiting = [
        _pool.submit(kernel, *arguments, part, edges[part], edges[part + 1])
        for part in range(1, threads)
    ]
    kernel(*arguments, 0, edges[0], edges[1])
    for part in waiting:
        part.result()
