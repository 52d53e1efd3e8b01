"""Work on many worlds, spread over threads; worlds know nothing of each other."""

from __future__ import annotations

import functools
import itertools
import os
import threading
from collections.abc import Callable
from typing import Any, Final, TypeVar

import numpy as np

from posse.compiled import UNCOMPILED
from posse.lookout import look_out

T = TypeVar("T")

_SERIAL_BELOW: Final = 2048
"""Robots below which a second thread costs more than it saves."""
_PARTS: Final = 4
"""Parts of the worlds for each thread."""
_LOOKS: Final = 400_000
"""How often who waits looks before it falls asleep: for some tenths of a millisecond. Where there
are more threads than cores it falls asleep at once."""
_PAUSE: Final = 10_000
"""How often a helper looks once more after its bell: until the caller is in the kernel, and has let
go of the interpreter's lock. To find it taken would send the helper to sleep after all."""


def threads_for(num_worlds: int, robots_each: int, most: int) -> int:
    """Return how many threads so many worlds are worth, at most ``most``."""
    return 1 if num_worlds * robots_each < _SERIAL_BELOW else min(most, num_worlds)


def by_turns(work: Callable[[int, int, int], T], num_worlds: int, threads: int) -> list[T]:
    """Call ``work(thread, first, last)`` for parts that together are all worlds, from 0 on.

    Threads take the next part by turns, so that none waits long for a slower one; the caller's is
    thread 0. Returns what the calls returned, in no order. While another thread of the program is
    here, the caller does everything by itself.
    """
    if threads == 1 or UNCOMPILED:
        return [work(0, 0, num_worlds)]
    crew = _crew()
    if not crew.free.acquire(blocking=False):
        return [work(0, 0, num_worlds)]
    try:
        return crew.share(work, num_worlds, threads)
    except BaseException:
        _leave(crew)
        raise
    finally:
        crew.free.release()


class _Bell:
    """Rung by one thread and waited for by another.

    To wake a thread that sleeps can take longer than a thousand worlds take for a step, so who
    waits looks out for the bell for a moment before it falls asleep.
    """

    def __init__(self, looks: int) -> None:
        self._looks = looks
        self._rung = np.zeros(1, np.int64)
        self._heard = 0
        self._asleep = False
        self._wake = threading.Semaphore(0)

    def ring(self) -> None:
        self._rung[0] += 1
        if self._asleep:
            self._asleep = False
            self._wake.release()

    def wait(self, pause: int = 0) -> None:
        if not look_out(self._rung, self._heard, self._looks, pause):
            while self._rung[0] == self._heard:
                self._asleep = True
                # Once more: it may have been rung before it could be seen that this one sleeps.
                if self._rung[0] == self._heard:
                    self._wake.acquire()
        self._heard += 1


class _Helper(threading.Thread):
    """A thread that does what it is given, again and again."""

    def __init__(self, number: int) -> None:
        super().__init__(name=f"posse-{number}", daemon=True)
        looks = _LOOKS if number < _cores() else 0
        self.begin, self.done = _Bell(looks), _Bell(looks)
        self.task: Callable[[], list[Any]] | None = None
        self.dismissed = False
        self.results: list[Any] = []
        self.error: BaseException | None = None
        self.start()

    def run(self) -> None:
        while True:
            self.begin.wait(_PAUSE)
            task, self.task = self.task, None
            if self.dismissed or task is None:
                return
            try:
                self.results = task()
            except BaseException as error:  # for the caller to raise
                self.error = error
            del task  # it holds the step's arrays, whose memory is used again when nobody does
            self.done.ring()


def _cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class _Crew:
    """The helpers of one process."""

    def __init__(self) -> None:
        self.process = os.getpid()
        self.free = threading.Lock()
        self.helpers: list[_Helper] = []

    def share(self, work: Callable[[int, int, int], T], num_worlds: int, threads: int) -> list[T]:
        count = min(num_worlds, threads * _PARTS)
        edges = [num_worlds * k // count for k in range(count + 1)]
        parts = iter(list(itertools.pairwise(edges)))

        def take(thread: int) -> list[T]:
            return [work(thread, first, last) for first, last in parts]

        while len(self.helpers) < threads - 1:
            self.helpers.append(_Helper(len(self.helpers) + 1))
        helpers = self.helpers[: threads - 1]
        begun = []
        try:
            for thread, helper in enumerate(helpers, 1):
                helper.task = functools.partial(take, thread)
                helper.begin.ring()
                begun.append(helper)
            results = take(0)
        finally:
            for _ in parts:  # after an error: nobody begins another part, or is still at one
                pass
            for helper in begun:
                helper.done.wait()
        for helper in helpers:
            if helper.error is not None:
                raise helper.error
            results += helper.results
            helper.results = []
        return results


_present: _Crew | None = None


def _crew() -> _Crew:
    global _present
    if _present is None or _present.process != os.getpid():
        _present = _Crew()  # threads do not survive a fork
    return _present


def _leave(crew: _Crew) -> None:
    """Have the next work done by others; these helpers end."""
    global _present
    if _present is crew:
        _present = None
    for helper in crew.helpers:
        helper.dismissed = True
        helper.begin.ring()
