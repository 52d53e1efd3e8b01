"""Calls of a kernel in several threads, which share the worlds."""

import concurrent.futures as futures
import contextlib
import functools
import itertools
import os
import signal
import threading
from collections.abc import Callable, Iterator
from typing import Any, Final

from posse.numeric.compile import UNCOMPILED
from posse.numeric.lanes import WIDTH

MOST_THREADS: Final = len(getattr(os, "sched_getaffinity", lambda _: range(os.cpu_count() or 1))(0))
"""Number of cores available to the process."""
_SERIAL_BELOW: Final = 2048  # robots; below, a second thread costs more than it saves
_LEAST_SHARE: Final = 8 * WIDTH  # of many worlds; to step them takes several times as long as a call


@functools.cache
def _executor() -> futures.ThreadPoolExecutor:
    return futures.ThreadPoolExecutor(max(1, MOST_THREADS - 1), "posse")


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_executor.cache_clear)  # a forked process has none of the threads


def threads_for(num_worlds: int, robots_each: int, most: int) -> int:
    """Return the number of threads for a number of worlds, at most ``most``."""
    return 1 if UNCOMPILED or num_worlds * robots_each < _SERIAL_BELOW else min(most, -(-num_worlds // WIDTH))


@functools.lru_cache(maxsize=64)
def _shares_of(num_worlds: int, threads: int) -> list[tuple[int, int]]:
    """Return shares of whole eights of worlds, ever smaller ones, so that the threads end at the same time.

    The first is three quarters of a thread's part: a thread that the system interrupts leaves the rest to the others.
    """
    # Shares of few worlds are smaller, or the caller would take them all before another thread begins.
    least = max(WIDTH, min(_LEAST_SHARE, num_worlds // (4 * threads) // WIDTH * WIDTH))
    ends = [0]
    while ends[-1] < num_worlds:
        share = max(least, 3 * (num_worlds - ends[-1]) // (4 * threads) // WIDTH * WIDTH)
        ends.append(min(num_worlds, ends[-1] + share))
    return list(itertools.pairwise(ends))


@contextlib.contextmanager
def _interrupts_wait() -> Iterator[None]:
    """Call the handler of SIGINT, if one came, at the end: an exception within an executor can leave a lock held."""
    handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield
        return
    received: list[Any] = []
    try:
        signal.signal(signal.SIGINT, lambda *signal_and_frame: received.append(signal_and_frame))
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
        if received:
            handler(*received[-1])


def over_worlds(
    kernel: Callable[..., Any], arguments: tuple[Any, ...], num_worlds: int, robots_each: int, most: int = MOST_THREADS
) -> list[Any]:
    """Call ``kernel(*arguments, thread, first, end)`` for shares of the worlds; return the results, in any order.

    Shares are of whole eights, which are observed together. Up to ``most`` threads, numbered from 0, take them. An
    exception propagates when all threads are done; so does an interrupt.
    """
    threads = threads_for(num_worlds, robots_each, most)
    if threads == 1:
        return [kernel(*arguments, 0, 0, num_worlds)]
    *shared, last = _shares_of(num_worlds, threads)
    # All threads take from these, and the caller alone takes the last: so it rarely waits, and waking it takes long.
    shares = iter(shared)

    def work(thread: int) -> list[Any]:
        return [kernel(*arguments, thread, first, end) for first, end in shares]

    with _interrupts_wait():
        others = [_executor().submit(work, thread) for thread in range(1, threads)]
        try:
            results = [*work(0), kernel(*arguments, 0, *last)]
        finally:
            others = [other for other in others if not other.cancel()]  # not begun: the shares are all taken
            futures.wait(others)
    return results + [result for other in others for result in other.result()]
