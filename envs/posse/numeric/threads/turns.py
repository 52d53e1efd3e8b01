"""Work on many worlds, spread over threads; worlds know nothing of each other."""

from __future__ import annotations

import functools
import os
import threading
from collections.abc import Callable
from typing import Any, Final, TypeVar

import numpy as np

from posse.numeric.compiling import UNCOMPILED
from posse.numeric.simd.lanes import WIDTH as TOGETHER
from posse.numeric.threads.turn_code import (
    BELL,
    END,
    HEARD,
    NEXT,
    NO_BELL,
    SIZE,
    TURN,
    WAKE,
    Numbers,
    look_out,
    ring,
)

T = TypeVar("T")

_SERIAL_BELOW: Final = 2048
"""Robots below which a second thread costs more than it saves."""
_PARTS: Final = 16
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


@functools.lru_cache(maxsize=64)
def all_at_once(num_worlds: int) -> Numbers:
    """Return the turns of a thread that does everything by itself; they may be used again."""
    turns = np.zeros((1, TURN), np.int64)
    turns[0, END] = num_worlds
    return turns


def by_turns(work: Callable[[int, Numbers], T], num_worlds: int, threads: int) -> list[T]:
    """Call ``work(thread, turns)`` once for each thread, which together are all worlds.

    What is called goes through :func:`posse.numeric.worlds_of` its thread, or ``parts_of``, which
    hand worlds out part by part, so that no thread waits long for a slower one; the caller's is
    thread 0. Returns what the calls returned, in no order. While another thread of the program is
    here, the caller does everything by itself.
    """
    if threads == 1 or UNCOMPILED:
        return [work(0, all_at_once(num_worlds))]
    crew = _crew()
    if not crew.free.acquire(blocking=False):
        return [work(0, all_at_once(num_worlds))]
    try:
        return crew.share(work, _fresh_turns(num_worlds, threads).copy())
    except BaseException:
        _leave(crew)
        raise
    finally:
        crew.free.release()


@functools.lru_cache(maxsize=64)
def _fresh_turns(num_worlds: int, threads: int) -> Numbers:
    """Return turns of which none is taken."""
    # Eights of worlds are observed together, and so faster where teams are small.
    grain = TOGETHER if num_worlds >= threads * _PARTS * TOGETHER // 2 else 1
    edges = [num_worlds * k // (threads * grain) * grain for k in range(threads)] + [num_worlds]
    turns = np.zeros((threads, TURN), np.int64)
    turns[:, NEXT], turns[:, END] = edges[:-1], edges[1:]
    turns[:, SIZE] = max(1, num_worlds // (threads * _PARTS * grain)) * grain
    return turns


class _Bell:
    """Rung by one thread and waited for by another.

    To wake a thread that sleeps can take longer than a thousand worlds take for a step, so who
    waits looks out for the bell for a moment before it falls asleep.
    """

    def __init__(self, looks: int) -> None:
        self._looks = looks
        self._state = np.zeros(BELL, np.int64)
        self._heard = 0
        self._wake = threading.Semaphore(0)

    def ring(self) -> None:
        if ring(self._state):
            self._wake.release()

    def wait(self, pause: int = 0, answer: _Bell | None = None) -> None:
        """Ring another bell, if given, and wait for this one."""
        told = NO_BELL if answer is None else answer._state
        # To be woken is no proof that this bell was rung: who rang it last may have been held up
        # between ringing and looking for sleepers, and have come upon this later sleep.
        while (said := look_out(self._state, self._heard, self._looks, pause, told)) != HEARD:
            told = NO_BELL
            if said == WAKE and answer is not None:
                answer._wake.release()
            else:
                self._wake.acquire()
        self._heard += 1


class _Helper(threading.Thread):
    """A thread that does what it is given, again and again."""

    def __init__(self, number: int) -> None:
        super().__init__(name=f"posse-{number}", daemon=True)
        looks = _LOOKS if number < _cores() else 0
        self.begin, self.done = _Bell(looks), _Bell(looks)
        self.task: Callable[[], Any] | None = None
        self.dismissed = False
        self.result: Any = None
        self.error: BaseException | None = None
        self.start()

    def run(self) -> None:
        done: _Bell | None = None
        while True:
            self.begin.wait(_PAUSE, answer=done)
            task, self.task = self.task, None
            if self.dismissed or task is None:
                return
            try:
                self.result = task()
            except BaseException as error:  # for the caller to raise
                self.error = error
            del task  # it holds the step's arrays, whose memory is used again when nobody does
            done = self.done


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

    def share(self, work: Callable[[int, Numbers], T], turns: Numbers) -> list[T]:
        others = len(turns) - 1
        while len(self.helpers) < others:
            self.helpers.append(_Helper(len(self.helpers) + 1))
        helpers = self.helpers[:others]
        begun = []
        try:
            for thread, helper in enumerate(helpers, 1):
                helper.task = functools.partial(work, thread, turns)
                helper.begin.ring()
                begun.append(helper)
            results = [work(0, turns)]
        except BaseException:
            turns[:, NEXT] = turns[:, END]  # nobody begins another part
            raise
        finally:
            for helper in begun:
                helper.done.wait()
        for helper in helpers:
            if helper.error is not None:
                raise helper.error
            results.append(helper.result)
            helper.result = None
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
