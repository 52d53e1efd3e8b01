"""Work on many worlds, spread over threads; worlds know nothing of each other."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Final, TypeVar

T = TypeVar("T")

_SERIAL_BELOW: Final = 2048
"""Robots below which waking another thread costs more than it saves."""
_PARTS: Final = 4
"""Parts of the worlds for each thread."""
_MOST_THREADS: Final = 256

_pool: ThreadPoolExecutor | None = None
_process = -1


def threads_for(num_worlds: int, robots_each: int, most: int) -> int:
    """Return how many threads so many worlds are worth, at most ``most``."""
    return 1 if num_worlds * robots_each < _SERIAL_BELOW else min(most, num_worlds)


def by_turns(work: Callable[[int, int, int], T], num_worlds: int, threads: int) -> list[T]:
    """Call ``work(thread, first, last)`` for parts that together are all worlds, from 0 on.

    Threads take the next part by turns, so that none waits long for a slower one; the caller's is
    thread 0. Returns what the calls returned, in no order.
    """
    if threads == 1:
        return [work(0, 0, num_worlds)]
    count = min(num_worlds, threads * _PARTS)
    edges = [num_worlds * k // count for k in range(count + 1)]
    parts = iter(list(itertools.pairwise(edges)))

    def take(thread: int) -> list[T]:
        return [work(thread, first, last) for first, last in parts]

    pool = _threads()
    waiting = [pool.submit(take, thread) for thread in range(1, threads)]
    results = take(0)
    for others in waiting:
        results += others.result()
    return results


def _threads() -> ThreadPoolExecutor:
    """Return threads that wait asleep for work; each is started when it is first needed."""
    global _pool, _process
    if _pool is None or _process != os.getpid():
        _pool = ThreadPoolExecutor(_MOST_THREADS, "posse")
        _process = os.getpid()  # threads do not survive a fork
    return _pool
