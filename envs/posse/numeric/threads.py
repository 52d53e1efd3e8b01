"""Calls of a compiled function in several threads, which share the worlds.

Waiters spin briefly, then block: waking a blocked thread can take longer than a step of a thousand
worlds, and handing over Python's lock longer than a step of a hundred.
"""

from __future__ import annotations

import atexit
import functools
import itertools
import os
import threading
import time
import weakref
from collections.abc import Callable
from queue import SimpleQueue
from typing import Any, Final, TypeVar

import numpy as np

from posse.numeric.blocks import Blocks, divide
from posse.numeric.compiling import UNCOMPILED, kernel
from posse.numeric.simd import atomics

T = TypeVar("T")
_SERIAL_BELOW: Final = 2048  # robots; below, a second thread costs more than it saves
_LOOKS: Final = 400_000  # turns of a spin, some tenths of a millisecond
_SOON: Final = 5e-4  # s; a worker that waited longer blocks at once the next time
_PAUSE: Final = 10_000  # turns until the caller's kernel has released Python's lock
_ENDED: Final = 2**62
_LEVELS: Final = 12  # exceptions within some microseconds that a step survives
MOST_THREADS: Final = len(getattr(os, "sched_getaffinity", lambda _: range(os.cpu_count() or 1))(0))
"""Most threads that :func:`over_worlds` uses: the number of cores available to the process."""


@kernel
def _spin(own: Blocks, counter: Blocks, target: int, looks: int, pause: int) -> None:
    """Increment a counter; then spin until another one reaches a target, and a pause longer."""
    atomics.add(own, 1)
    for _ in range(looks):
        if atomics.read(counter) >= target:
            for _ in range(pause):
                atomics.read(counter)
            return


def threads_for(num_worlds: int, robots_each: int, most: int) -> int:
    """Return the number of threads for a number of worlds, at most ``most``."""
    return 1 if num_worlds * robots_each < _SERIAL_BELOW else min(most, num_worlds)


def over_worlds(kernel: Callable[..., None], arguments: tuple[Any, ...], num_worlds: int, num_trackers: int) -> None:
    """Call ``kernel(*arguments, thread, blocks)`` in at most ``MOST_THREADS`` threads."""
    threads = threads_for(num_worlds, num_trackers, MOST_THREADS)
    run_threads(functools.partial(kernel, *arguments), num_worlds, threads)


def run_threads(work: Callable[[int, Blocks], T], num_worlds: int, threads: int) -> list[T]:
    """Call ``work(thread, blocks)`` in up to ``threads`` threads; return the results of the calls.

    Each call takes worlds from :func:`worlds_of` or :func:`blocks_of`. The caller is thread 0, and
    the only one while another thread of the program uses the workers. An exception raised by a
    signal handler propagates when all worlds are done, or before any is started.
    """
    if threads == 1 or UNCOMPILED:
        return [work(0, divide(num_worlds, 1))]
    return _finished(_LEVELS, work, divide(num_worlds, threads).copy(), [])


def _finished(levels: int, work: Any, blocks: Blocks, workers: list[_Worker]) -> list[Any]:
    """Share the work; after an exception, wait for the workers. A level survives one exception."""
    try:
        if levels == 0:
            return _share(work, blocks, workers)
        return _finished(levels - 1, work, blocks, workers)
    except BaseException:
        _end(workers)
        raise


def _share(work: Callable[[int, Blocks], T], blocks: Blocks, workers: list[_Worker]) -> list[T]:
    while len(workers) < len(blocks) - 1:
        try:
            workers.append(_idle.pop())
        except IndexError:
            if len(_alive) >= max(len(blocks), MOST_THREADS) - 1:
                break  # in use by another thread of the program
            workers.append(_Worker())
    for thread, worker in enumerate(workers, 1):
        worker.tasks.put(functools.partial(work, thread, blocks))
        worker.given += 1
    results = [work(0, blocks)]
    for worker in workers:
        _spin(np.zeros(1, np.int64), worker.done, int(worker.given[0]), worker.looks, 0)
        result, error = worker.results.get()
        if error is not None:
            raise error
        results.append(result)
    while workers:
        _idle.append(workers.pop())
    return results


class _Worker:
    """A thread with its queues of tasks and results."""

    def __init__(self) -> None:
        self.tasks: SimpleQueue[Callable[[], Any] | None] = SimpleQueue()
        self.results: SimpleQueue[tuple[Any, BaseException | None]] = SimpleQueue()
        self.given, self.done = np.zeros(1, np.int64), np.full(1, -1)
        self.looks = _LOOKS if len(_alive) < MOST_THREADS - 1 else 0  # spinning occupies a core
        weakref.finalize(self, self.tasks.put, None)  # ends the thread
        arguments = self.tasks, self.results, self.given, self.done, self.looks
        threading.Thread(target=_serve, args=arguments, name="posse", daemon=True).start()
        _alive.add(self)


def _serve(tasks: Any, results: Any, given: Any, done: Any, looks: int) -> None:
    """Execute tasks until one is None. Holds no reference to the worker, so it can be freed."""
    waited = 0.0
    for count in itertools.count(1):
        # Where tasks come seldom, a spin would take the core from a network's threads.
        worth = looks if waited < _SOON else 0
        began = time.perf_counter()
        _spin(done, given, count, worth, _PAUSE)  # counts the last task, without Python's lock
        task = tasks.get()
        waited = time.perf_counter() - began
        if task is None:
            break
        try:
            outcome: Any = task(), None
        except BaseException as error:  # raised by the caller
            outcome = None, error
        del task  # releases the step's arrays, whose memory is reused
        results.put(outcome)
    done[0] = _ENDED


def _end(workers: list[_Worker]) -> None:
    """Wait until workers have finished their tasks and ended, ignoring exceptions meanwhile."""
    while workers:
        try:
            for worker in workers:
                worker.tasks.put(None)
            # Not Thread.join, which after an interrupt takes a running thread for an ended one.
            while any(worker.done[0] != _ENDED for worker in workers):
                time.sleep(1e-4)
            _alive.difference_update(workers)
            workers.clear()
        except BaseException:
            continue


_idle: Final[list[_Worker]] = []
_alive: Final[weakref.WeakSet[_Worker]] = weakref.WeakSet()
atexit.register(_end, _idle)
for _threads in (_idle, _alive) if hasattr(os, "register_at_fork") else ():
    os.register_at_fork(after_in_child=_threads.clear)  # a forked process has none of them
