"""Threads: every world is processed once, and errors leave no unfinished work."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import posse
from posse.numeric import Blocks, divide, kernel, run_threads, threads, worlds_of
from posse.numeric.blocks import END, NEXT, SIZE


@kernel
def count(times: npt.NDArray[np.int64], thread: int, blocks: Blocks) -> int:
    """Count how often each world is processed; return the number processed by this thread."""
    worlds = 0
    for e in worlds_of(thread, blocks):
        times[e] += 1
        worlds += 1
    return worlds


class Ledger:
    """Counts how often each world is processed, and by which thread; some threads start late."""

    def __init__(self, worlds: int, late: tuple[int, ...] = ()) -> None:
        self.times = np.zeros(worlds, np.int64)
        self.late = late
        self.shares: dict[int, int] = {}

    def work(self, thread: int, blocks: Blocks) -> int:
        if thread in self.late:
            time.sleep(0.03)
        self.shares[thread] = count(self.times, thread, blocks)
        return self.shares[thread]


def workers() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "posse"]


def wait_for(condition: Callable[[], bool], seconds: float = 10.0) -> bool:
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.005)
    return condition()


@pytest.fixture
def no_workers() -> None:
    """Begin without workers, as a new process does."""
    threads._end(threads._idle)
    assert wait_for(lambda: not workers())


@pytest.mark.usefixtures("no_workers")
@pytest.mark.parametrize("looks", [0, threads._LOOKS])
@pytest.mark.parametrize("wanted", [1, 2, 3, 9])
def test_every_world_is_done_once(wanted: int, looks: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threads, "_LOOKS", looks)  # spinning, or blocked
    monkeypatch.setattr(threads, "MOST_THREADS", 10)
    for worlds in (1, 2, 7, 1000):
        for pause in (0.0, 0.02):  # workers still spin, or are blocked
            time.sleep(pause)
            ledger = Ledger(worlds)
            assert sum(run_threads(ledger.work, worlds, wanted)) == worlds
            assert (ledger.times == 1).all()
            assert set(ledger.shares) == set(range(wanted))
    assert len(workers()) == wanted - 1


@pytest.mark.parametrize("late", [(0,), (1,), (0, 2), (1, 2)])
def test_nobody_waits_for_a_slow_thread(late: tuple[int, ...]) -> None:
    ledger = Ledger(1000, late)
    assert sum(run_threads(ledger.work, 1000, 3)) == 1000
    assert (ledger.times == 1).all()
    assert all(ledger.shares[thread] == 0 for thread in late)


def test_a_thread_begins_with_worlds_of_its_own() -> None:
    """Its core has cached them in the previous step."""
    begun = {}

    @kernel
    def first(thread: int, blocks: Blocks) -> int:
        for e in worlds_of(thread, blocks):
            return e
        return -1

    def work(thread: int, blocks: Blocks) -> None:
        begun[thread] = first(thread, blocks)

    run_threads(work, 90, 3)
    assert begun == {0: 0, 1: 30, 2: 60}


@pytest.mark.parametrize(("worlds", "wanted"), [(1024, 2), (1000, 3), (8192, 8), (513, 4)])
def test_blocks_of_many_worlds_are_eights(worlds: int, wanted: int) -> None:
    """Eight are observed together; only the end of all may be less."""
    blocks = divide(worlds, wanted)
    assert (blocks[:, NEXT] % 8 == 0).all()
    assert (blocks[:, SIZE] % 8 == 0).all()
    np.testing.assert_array_equal(blocks[1:, NEXT], blocks[:-1, END])
    assert blocks[-1, END] == worlds


def test_no_block_is_taken_twice_however_many_want_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("posse.numeric.blocks._BLOCKS_EACH", 20_000)
    divide.cache_clear()
    worlds = 100_003
    try:
        for _ in range(30):
            ledger = Ledger(worlds)
            assert sum(run_threads(ledger.work, worlds, 4)) == worlds
            assert (ledger.times == 1).all()
    finally:
        divide.cache_clear()


@pytest.mark.parametrize("thread_that_fails", [0, 1])
def test_an_error_reaches_the_caller_and_the_next_work_is_done(thread_that_fails: int) -> None:
    def fail(thread: int, blocks: Blocks) -> int:
        if thread == thread_that_fails:
            raise ArithmeticError(f"thread {thread}")
        return 0

    with pytest.raises(ArithmeticError, match=f"thread {thread_that_fails}"):
        run_threads(fail, 100, 2)
    ledger = Ledger(100)
    assert sum(run_threads(ledger.work, 100, 2)) == 100
    assert (ledger.times == 1).all()
    assert set(ledger.shares) == {0, 1}


def test_an_error_goes_on_when_the_workers_have_done_all_worlds() -> None:
    begun, times = threading.Event(), np.zeros(100, np.int64)

    def work(thread: int, blocks: Blocks) -> int:
        if thread == 0:
            begun.wait(5)
            raise KeyboardInterrupt
        begun.set()
        time.sleep(0.05)
        return count(times, thread, blocks)

    with pytest.raises(KeyboardInterrupt):
        run_threads(work, 100, 2)
    assert (times == 1).all()


def test_a_second_interrupt_does_not_cut_the_wait_short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also for a third exception, raised by ``time.sleep`` while a worker is busy."""
    ended, interrupts, sleep = [], 0, time.sleep

    def interrupted(seconds: float) -> None:
        nonlocal interrupts
        sleep(seconds)
        if threading.current_thread() is threading.main_thread():
            interrupts += 1
            raise KeyboardInterrupt

    def work(thread: int, blocks: Blocks) -> int:
        if thread == 0:
            raise ArithmeticError
        sleep(0.05)
        ended.append(thread)
        return 0

    monkeypatch.setattr(time, "sleep", interrupted)
    with pytest.raises(ArithmeticError):
        run_threads(work, 100, 2)
    assert ended == [1]
    assert interrupts > 1


def test_without_a_compiler_the_caller_is_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threads, "UNCOMPILED", True)
    ledger = Ledger(100)
    assert run_threads(ledger.work, 100, 3) == [100]
    assert ledger.shares == {0: 100}


@pytest.mark.usefixtures("no_workers")
def test_workers_that_an_error_left_behind_end_and_new_ones_come() -> None:
    def fail(thread: int, blocks: Blocks) -> int:
        raise ArithmeticError

    for _ in range(20):
        with pytest.raises(ArithmeticError) as kept:  # its traceback knows the workers
            run_threads(fail, 10, 2)
        assert kept.value.__traceback__ is not None
        ledger = Ledger(10)
        run_threads(ledger.work, 10, 2)
        assert set(ledger.shares) == {0, 1}
        assert wait_for(lambda: len(workers()) == 1)


def test_many_callers_at_once_are_all_served_by_few_workers() -> None:
    ledgers = [Ledger(500, late=(0,)) for _ in range(8)]
    callers = [threading.Thread(target=run_threads, args=(ledger.work, 500, 2)) for ledger in ledgers]
    for caller in callers:
        caller.start()
    most = len(workers())
    for caller in callers:
        caller.join()
    assert all((ledger.times == 1).all() for ledger in ledgers)
    assert most <= max(threads.MOST_THREADS - 1, 8)


PROLOGUE = """
import atexit, os, threading, time

workers = []

@atexit.register  # before posse, so called after it
def report():
    if workers:
        time.sleep(0.05)  # from the end of its work to the end of a thread
        os.write(1, str([t.is_alive() for t in workers]).encode())

import numpy as np
from posse.numeric import kernel, run_threads, worlds_of

@kernel
def count(times, thread, blocks):
    for e in worlds_of(thread, blocks):
        times[e] += 1
    return 0

def done(worlds=100):
    times = np.zeros(worlds, np.int64)
    served = set()
    def work(thread, blocks):
        served.add(thread)
        return count(times, thread, blocks)
    run_threads(work, worlds, 3)
    assert (times == 1).all()
    return len(served)
"""


def run_python(code: str, tmp_path: Path) -> str:
    script = tmp_path / "script.py"
    script.write_text(PROLOGUE + code)
    done = subprocess.run(
        [sys.executable, "-W", "error", str(script)], capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_forked_process_has_workers_of_its_own(tmp_path: Path) -> None:
    said = run_python(
        """
assert done() == 3
child = os.fork()
if child == 0:
    alone = threading.active_count()
    served = done()
    os.write(1, f"{alone} {served} {threading.active_count()}".encode())
    os._exit(0)
assert os.waitpid(child, 0)[1] == 0
assert done() == 3
""",
        tmp_path,
    )
    assert said == "1 3 3"


@pytest.mark.parametrize("pause", [0.0, 0.2])
def test_a_process_ends_after_its_workers(pause: float, tmp_path: Path) -> None:
    """They spin still, or are blocked."""
    said = run_python(
        f"""
done()
workers.extend(t for t in threading.enumerate() if t.name == "posse")
time.sleep({pause})
""",
        tmp_path,
    )
    assert said == "[False, False]"


def test_memory_of_observations_is_used_again_with_threads_too() -> None:
    """Workers keep no references to a finished step."""
    batch = posse.batch("smart", 600, num_threads=2)
    batch.reset(seed=0)
    actions = np.zeros(batch.action_shape, np.float32)
    places = {batch.step(actions)[0].ctypes.data for _ in range(20)}
    assert len(places) == 1
