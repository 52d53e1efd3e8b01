"""Calls of a kernel in several threads, which share the worlds."""

from __future__ import annotations

import contextlib
import functools
import os
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
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

    Each call takes the worlds of :func:`worlds_of`. An exception, such as a signal handler's, propagates when no
    thread is at work.
    """
    threads = 1 if UNCOMPILED else threads_for(num_worlds, robots_each, most)
    blocks = divide(num_worlds, threads)
    shares: list[Future[Any]] = [Future() for _ in range(threads - 1)]

    def work(thread: int) -> None:
        share = shares[thread - 1]
        if share.set_running_or_notify_cancel():
            try:
                share.set_result(kernel(*arguments, thread, blocks))
            except BaseException as error:
                share.set_exception(error)

    try:
        with contextlib.suppress(RuntimeError):  # no thread can be started
            for thread in range(1, threads):
                _pool().submit(work, thread)
        results = [kernel(*arguments, 0, blocks)]
        for thread, share in enumerate(shares, 1):
            mine = share.cancel()  # not begun, since the pool is busy
            results.append(kernel(*arguments, thread, blocks) if mine else share.result())
        return results
    finally:
        wait([share for share in shares if not share.cancel()])
