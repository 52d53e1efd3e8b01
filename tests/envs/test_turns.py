"""Threads: every world is somebody's turn once, and nothing that goes wrong stays behind."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest

import posse
from posse import turns
from posse.turns import by_turns


class Ledger:
    """Counts how often each world was worked on, and by whom."""

    def __init__(self, worlds: int) -> None:
        self.times = np.zeros(worlds, np.int64)
        self.threads: set[int] = set()

    def work(self, thread: int, first: int, last: int) -> int:
        self.times[first:last] += 1
        self.threads.add(thread)
        time.sleep(0.001)  # so that others get their turn
        return last - first


@pytest.mark.parametrize("looks", [0, turns._LOOKS])
@pytest.mark.parametrize("threads", [1, 2, 3, 9])
def test_every_world_is_worked_on_once(
    threads: int, looks: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(turns, "_present", None)  # a crew of its own
    monkeypatch.setattr(turns, "_LOOKS", looks)  # awake, or asleep
    for worlds in (1, 2, 7, 1000):
        for pause in (0.0, 0.02):  # helpers still look out, or sleep
            time.sleep(pause)
            ledger = Ledger(worlds)
            assert sum(by_turns(ledger.work, worlds, threads)) == worlds
            assert (ledger.times == 1).all()
            assert ledger.threads <= set(range(threads))
            if worlds == 1000:
                assert len(ledger.threads) > threads // 3, "the work is shared"


@pytest.mark.parametrize("thread_that_fails", [0, 1])
def test_an_error_reaches_the_caller_and_the_next_work_is_done(thread_that_fails: int) -> None:
    def fail(thread: int, first: int, last: int) -> int:
        time.sleep(0.002)
        if thread == thread_that_fails:
            raise ArithmeticError(f"thread {thread}")
        return 0

    with pytest.raises(ArithmeticError, match=f"thread {thread_that_fails}"):
        by_turns(fail, 100, 2)
    ledger = Ledger(100)
    assert sum(by_turns(ledger.work, 100, 2)) == 100
    assert (ledger.times == 1).all()


def test_nobody_is_still_at_work_after_an_error() -> None:
    begun, ended = [], []

    def work(thread: int, first: int, last: int) -> int:
        begun.append(first)
        if thread == 0:
            raise KeyboardInterrupt
        time.sleep(0.05)
        ended.append(first)
        return 0

    with pytest.raises(KeyboardInterrupt):
        by_turns(work, 100, 2)
    count = len(begun)
    assert len(ended) == count - 1, "the caller waited for the helper's part"
    time.sleep(0.1)
    assert len(begun) == count, "no part was begun afterwards"


def test_without_a_compiler_the_caller_works_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(turns, "UNCOMPILED", True)
    ledger = Ledger(100)
    assert by_turns(ledger.work, 100, 3) == [100]
    assert ledger.threads == {0}


def test_helpers_that_an_error_left_behind_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(turns, "_present", None)
    by_turns(Ledger(10).work, 10, 3)
    helpers = list(turns._crew().helpers)

    def fail(thread: int, first: int, last: int) -> int:
        raise ArithmeticError

    with pytest.raises(ArithmeticError):
        by_turns(fail, 10, 2)
    for helper in helpers:
        helper.join(5)
        assert not helper.is_alive()


def test_two_at_once_are_both_served() -> None:
    ledgers = [Ledger(500), Ledger(500)]
    callers = [threading.Thread(target=by_turns, args=(ledger.work, 500, 2)) for ledger in ledgers]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join()
    assert all((ledger.times == 1).all() for ledger in ledgers)


def test_memory_of_observations_is_used_again_with_threads_too() -> None:
    """Helpers keep nothing of a step that is over."""
    batch = posse.batch("smart", 500, num_threads=2)
    batch.reset(seed=0)
    actions = np.zeros(batch.action_shape, np.float32)
    places = {batch.step(actions)[0].ctypes.data for _ in range(20)}
    assert len(places) == 1
