"""Threads: every world is processed exactly once, and errors leave no state behind."""

from __future__ import annotations

import threading
import time

import numpy as np
import numpy.typing as npt
import pytest

import posse
from posse.numeric.compiling import kernel
from posse.numeric.threads import turns
from posse.numeric.threads.turn_code import ASLEEP, END, NEXT, SIZE, Numbers, worlds_of
from posse.numeric.threads.turns import by_turns


@kernel
def count(times: npt.NDArray[np.int64], thread: int, mine: Numbers) -> int:
    """Count how often each world was worked on; return how many this thread had."""
    worlds = 0
    for e in worlds_of(thread, mine):
        times[e] += 1
        worlds += 1
    return worlds


class Ledger:
    """Counts how often each world was worked on, and by whom; some threads begin late."""

    def __init__(self, worlds: int, late: tuple[int, ...] = ()) -> None:
        self.times = np.zeros(worlds, np.int64)
        self.late = late
        self.shares: dict[int, int] = {}

    def work(self, thread: int, mine: Numbers) -> int:
        if thread in self.late:
            time.sleep(0.03)
        self.shares[thread] = count(self.times, thread, mine)
        return self.shares[thread]


@pytest.fixture
def new_crew(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(turns, "_present", None)


@pytest.mark.usefixtures("new_crew")
@pytest.mark.parametrize("looks", [0, turns._LOOKS])
@pytest.mark.parametrize("threads", [1, 2, 3, 9])
def test_every_world_is_worked_on_once(
    threads: int, looks: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(turns, "_LOOKS", looks)  # awake, or asleep
    for worlds in (1, 2, 7, 1000):
        for pause in (0.0, 0.02):  # helpers still look out, or sleep
            time.sleep(pause)
            ledger = Ledger(worlds)
            assert sum(by_turns(ledger.work, worlds, threads)) == worlds
            assert (ledger.times == 1).all()
            assert set(ledger.shares) == set(range(threads))


@pytest.mark.parametrize("late", [(0,), (1,), (0, 2), (1, 2)])
def test_nobody_waits_for_a_slow_thread(late: tuple[int, ...]) -> None:
    ledger = Ledger(1000, late)
    assert sum(by_turns(ledger.work, 1000, 3)) == 1000
    assert (ledger.times == 1).all()
    assert all(ledger.shares[thread] == 0 for thread in late)


def test_a_thread_begins_with_worlds_of_its_own() -> None:
    """They are in its core's cache from the step before."""
    begun = {}

    @kernel
    def first(thread: int, mine: Numbers) -> int:
        for e in worlds_of(thread, mine):
            return e
        return -1

    def work(thread: int, mine: Numbers) -> None:
        begun[thread] = first(thread, mine)

    by_turns(work, 90, 3)
    assert begun == {0: 0, 1: 30, 2: 60}


@pytest.mark.parametrize(("worlds", "threads"), [(1024, 2), (1000, 3), (8192, 8), (513, 4)])
def test_parts_of_many_worlds_are_eights(worlds: int, threads: int) -> None:
    """Eight are observed together; only the end of all may be less."""
    fresh = turns._fresh_turns(worlds, threads)
    assert (fresh[:, NEXT] % 8 == 0).all()
    assert (fresh[:, SIZE] % 8 == 0).all()
    np.testing.assert_array_equal(fresh[1:, NEXT], fresh[:-1, END])
    assert fresh[-1, END] == worlds


def test_no_part_is_taken_twice_however_many_want_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(turns, "_PARTS", 20_000)
    turns._fresh_turns.cache_clear()
    worlds = 100_003
    try:
        for _ in range(30):
            ledger = Ledger(worlds)
            assert sum(by_turns(ledger.work, worlds, 4)) == worlds
            assert (ledger.times == 1).all()
    finally:
        turns._fresh_turns.cache_clear()


@pytest.mark.parametrize("thread_that_fails", [0, 1])
def test_an_error_reaches_the_caller_and_the_next_work_is_done(thread_that_fails: int) -> None:
    def fail(thread: int, mine: Numbers) -> int:
        if thread == thread_that_fails:
            raise ArithmeticError(f"thread {thread}")
        return 0

    with pytest.raises(ArithmeticError, match=f"thread {thread_that_fails}"):
        by_turns(fail, 100, 2)
    ledger = Ledger(100)
    assert sum(by_turns(ledger.work, 100, 2)) == 100
    assert (ledger.times == 1).all()


def test_nobody_is_still_at_work_after_an_error() -> None:
    begun, ended, taken = threading.Event(), [], []

    def work(thread: int, mine: Numbers) -> int:
        if thread == 0:
            begun.wait(5)
            raise KeyboardInterrupt
        begun.set()
        time.sleep(0.05)
        taken.append(count(np.zeros(100, np.int64), thread, mine))
        ended.append(thread)
        return 0

    with pytest.raises(KeyboardInterrupt):
        by_turns(work, 100, 2)
    assert ended == [1], "the caller waited for the helper"
    assert taken == [0], "no part was begun afterwards"


@pytest.mark.parametrize("looks", [0, 1000])
def test_a_ring_that_was_held_up_does_not_pass_for_the_next(looks: int) -> None:
    """Ringing is two things: to count, and to wake who sleeps; a thread can be stopped between."""
    bell, heard = turns._Bell(looks), []

    def wait_twice() -> None:
        for number in (1, 2):
            bell.wait()
            heard.append(number)

    bell._state[0] += 1  # the first half of a ring
    waiting = threading.Thread(target=wait_twice)
    waiting.start()
    while bell._state[ASLEEP] == 0:  # until it sleeps for the second
        time.sleep(0.001)
    assert heard == [1]
    bell._state[ASLEEP] = 0  # and now the second half
    bell._wake.release()
    time.sleep(0.05)
    assert heard == [1]
    bell.ring()
    waiting.join(5)
    assert heard == [1, 2]


def test_without_a_compiler_the_caller_works_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(turns, "UNCOMPILED", True)
    ledger = Ledger(100)
    assert by_turns(ledger.work, 100, 3) == [100]
    assert ledger.shares == {0: 100}


@pytest.mark.usefixtures("new_crew")
def test_helpers_that_an_error_left_behind_end() -> None:
    by_turns(Ledger(10).work, 10, 3)
    helpers = list(turns._crew().helpers)
    assert len(helpers) == 2

    def fail(thread: int, mine: Numbers) -> int:
        raise ArithmeticError

    with pytest.raises(ArithmeticError):
        by_turns(fail, 10, 2)
    for helper in helpers:
        helper.join(5)
        assert not helper.is_alive()


def test_two_at_once_are_both_served() -> None:
    ledgers = [Ledger(500, late=(0,)), Ledger(500, late=(0,))]
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
