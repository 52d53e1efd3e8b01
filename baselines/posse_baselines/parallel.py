"""Kernels over worlds, spread over threads; worlds know nothing of each other."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final

_SERIAL_BELOW: Final = 2048
"""Trackers below which waking another thread costs more than it saves."""

_PARTS: Final = 4
"""Parts of the worlds for each thread, so that none waits long for a slower one."""

_PROCESSORS: Final = os.cpu_count() or 1

_pool: ThreadPoolExecutor | None = None
_process = -1


def most_threads() -> int:
    """Return how many threads :func:`over_worlds` uses at most."""
    return _PROCESSORS


def over_worlds(
    kernel: Callable[..., None], arguments: tuple[Any, ...], num_worlds: int, num_trackers: int
) -> None:
    """Call ``kernel(*arguments, thread, first, last)`` for parts that together are all worlds.

    Threads are numbered from 0 to at most :func:`most_threads` - 1, for kernels that need a place
    of their own to work in.
    """
    global _pool, _process
    threads = min(most_threads(), num_worlds)
    if threads == 1 or num_worlds * num_trackers < _SERIAL_BELOW:
        kernel(*arguments, 0, 0, num_worlds)
        return
    if _pool is None or _process != os.getpid():
        _pool = ThreadPoolExecutor(threads, "posse-policy")
        _process = os.getpid()  # threads do not survive a fork
    count = min(num_worlds, threads * _PARTS)
    edges = [num_worlds * k // count for k in range(count + 1)]
    parts = iter(list(itertools.pairwise(edges)))  # each thread takes the next one

    def work(thread: int) -> None:
        for first, last in parts:
            kernel(*arguments, thread, first, last)

    waiting = [_pool.submit(work, thread) for thread in range(1, threads)]
    work(0)
    for thread in waiting:
        thread.result()
