"""Calls of a kernel in several threads, which share the worlds."""

from __future__ import annotations

import contextlib
import functools
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from queue import Empty, SimpleQueue
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse.numeric.compile import UNCOMPILED, compiled
from posse.numeric.lanes import WIDTH

Blocks = npt.NDArray[np.int64]
"""First world of each thread, and the number of worlds, (threads + 1,)."""

MOST_THREADS: Final = len(getattr(os, "sched_getaffinity", lambda _: range(os.cpu_count() or 1))(0))
"""Number of cores available to the process."""
_SERIAL_BELOW: Final = 2048  # robots; below, a second thread costs more than it saves


@functools.cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max(1, MOST_THREADS - 1), "posse")


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)  # a forked process has none of the threads


def threads_for(num_worlds: int, robots_each: int, most: int) -> int:
    """Return the number of threads for a number of worlds, at most ``most``."""
    return 1 if num_worlds * robots_each < _SERIAL_BELOW else min(most, -(-num_worlds // WIDTH))


@functools.lru_cache(maxsize=64)
def divide(num_worlds: int, threads: int) -> Blocks:
    """Return equal shares of the worlds, in whole eights, since eight worlds are observed together."""
    eights = -(-num_worlds // WIDTH)
    return np.array([min(num_worlds, eights * k // threads * WIDTH) for k in range(threads + 1)])


@compiled
def worlds_of(thread: int, blocks: Blocks) -> range:
    """Return the worlds of a thread."""
    return range(blocks[thread], blocks[thread + 1])


def over_worlds(
    kernel: Callable[..., Any], arguments: tuple[Any, ...], num_worlds: int, robots_each: int, most: int = MOST_THREADS
) -> list[Any]:
    """Call ``kernel(*arguments, thread, blocks)`` in up to ``most`` threads; return the results by thread.

    Each call takes the worlds of :func:`worlds_of`. An exception, such as a signal handler's, propagates when all
    shares are done.
    """
    threads = 1 if UNCOMPILED else threads_for(num_worlds, robots_each, most)
    blocks = divide(num_worlds, threads)
    # Not futures and their wait(), which an interrupt can leave locked.
    outcomes: dict[int, tuple[Any, BaseException | None]] = {}
    in_pool: dict[int, bool] = {}  # whoever is first to enter a share does it
    ended: SimpleQueue[None] = SimpleQueue()

    def work(thread: int) -> None:
        if in_pool.setdefault(thread, True):
            try:
                outcomes[thread] = kernel(*arguments, thread, blocks), None
            except BaseException as error:
                outcomes[thread] = None, error
            ended.put(None)

    def finish() -> None:
        for thread in range(threads):
            if not in_pool.setdefault(thread, False) and thread not in outcomes:
                outcomes[thread] = None, None  # begun
                outcomes[thread] = kernel(*arguments, thread, blocks), None
        while len(outcomes) < threads:
            with contextlib.suppress(Empty):
                ended.get(timeout=0.01)

    try:
        with contextlib.suppress(RuntimeError):  # no thread can be started
            for thread in range(1, threads):
                _pool().submit(work, thread)
        finish()
    except BaseException:
        finish()
        raise
    for _, error in outcomes.values():
        if error is not None:
            raise error
    return [outcomes[thread][0] for thread in range(threads)]
