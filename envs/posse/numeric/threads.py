"""Calls of a kernel in several threads, which share the worlds.

The threads wait for jobs in a queue. An executor of :mod:`concurrent.futures` takes 20 µs longer to pass one on, as
much as 50 worlds' step, and an interrupt within its ``wait`` can leave a future locked, whose thread waits for ever.
"""

from __future__ import annotations

import functools
import itertools
import os
import threading
from collections.abc import Callable, Iterable
from queue import SimpleQueue
from typing import Any, Final

from posse.numeric.compile import UNCOMPILED
from posse.numeric.lanes import WIDTH

MOST_THREADS: Final = len(getattr(os, "sched_getaffinity", lambda _: range(os.cpu_count() or 1))(0))
"""Number of cores available to the process."""
_SERIAL_BELOW: Final = 2048  # robots; below, a second thread costs more than it saves
_LEAST_SHARE: Final = 16 * WIDTH  # of many worlds; to step them takes ten times as long as a call


@functools.cache
def _jobs() -> SimpleQueue[Callable[[], None]]:
    """Start the threads; return the queue of what they call."""
    jobs: SimpleQueue[Callable[[], None]] = SimpleQueue()

    def serve() -> None:
        while True:
            jobs.get()()

    for k in range(1, MOST_THREADS):
        threading.Thread(target=serve, name=f"posse-{k}", daemon=True).start()
    return jobs


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_jobs.cache_clear)  # a forked process has none of the threads


def threads_for(num_worlds: int, robots_each: int, most: int) -> int:
    """Return the number of threads for a number of worlds, at most ``most``."""
    return 1 if UNCOMPILED or num_worlds * robots_each < _SERIAL_BELOW else min(most, -(-num_worlds // WIDTH))


@functools.lru_cache(maxsize=64)
def _shares_of(num_worlds: int, threads: int) -> list[tuple[int, int]]:
    """Return shares of whole eights of worlds, ever smaller ones, so that the threads end at the same time.

    The first is three quarters of a thread's part: a thread that the system interrupts leaves the rest to the others.
    The last is the caller's, so that it ends last: to wake it would take as long as fifty worlds.
    """
    # Shares of few worlds are smaller, or the caller would take them all before another thread begins.
    least = max(WIDTH, min(_LEAST_SHARE, num_worlds // (4 * threads) // WIDTH * WIDTH))
    ends, last = [0], max(0, num_worlds - least) // WIDTH * WIDTH
    while ends[-1] < last:
        share = max(least, 3 * (last - ends[-1]) // (4 * threads) // WIDTH * WIDTH)
        ends.append(min(last, ends[-1] + share))
    return list(itertools.pairwise([*ends, num_worlds]))


def over_worlds(
    kernel: Callable[..., Any], arguments: tuple[Any, ...], num_worlds: int, robots_each: int, most: int = MOST_THREADS
) -> list[Any]:
    """Call ``kernel(*arguments, thread, first, end)`` for shares of the worlds; return the results, in any order.

    Shares are of whole eights, which are observed together. Up to ``most`` threads, numbered from 0, take them. An
    exception, such as a signal handler's, propagates when all shares are done.
    """
    threads = threads_for(num_worlds, robots_each, most)
    if threads == 1:
        return [kernel(*arguments, 0, 0, num_worlds)]
    *before, last = _shares_of(num_worlds, threads)
    shared, own = iter(before), iter([last])  # all threads take from what is shared
    results: list[Any] = []
    errors: list[BaseException] = []
    turns = [threading.RLock() for _ in range(threads)]  # each is held by its thread, in the end by the caller

    def take(thread: int, shares: Iterable[tuple[int, int]]) -> None:
        for first, end in shares:
            try:
                results.append(kernel(*arguments, thread, first, end))
            except BaseException as error:
                errors.append(error)

    def work(thread: int) -> None:
        if turns[thread].acquire(blocking=False):  # otherwise the caller has done all
            take(thread, shared)
            turns[thread].release()

    def finish() -> None:
        take(0, itertools.chain(shared, own))
        for turn in turns:
            turn.acquire()

    try:
        for thread in range(1, threads):
            _jobs().put(functools.partial(work, thread))
        finish()
    except BaseException:
        finish()
        raise
    if errors:
        raise errors[0]
    return results
