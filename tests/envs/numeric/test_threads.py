"""Threads: every world is done once, results do not depend on them, and an error leaves no work behind."""

import gc
import os
import signal
import time

import numpy as np
import numpy.typing as npt
import pytest

from posse.numeric import UNCOMPILED, kernel, over_worlds

threaded = pytest.mark.skipif(UNCOMPILED, reason="plain Python runs in one thread")


@kernel
def count(times: npt.NDArray[np.int64], thread: int, first: int, end: int) -> int:
    """Count how often each world is done; return where the share begins."""
    for e in range(first, end):
        times[e] += 1
    return first


@pytest.mark.parametrize("threads", [1, 2, 3, 9])
@pytest.mark.parametrize("worlds", [72, 3000, 1024])
def test_every_world_is_done_once(worlds: int, threads: int) -> None:
    times = np.zeros(worlds, np.int64)
    starts = over_worlds(count, (times,), worlds, 100, threads)
    assert (times == 1).all()
    assert all(start % 8 == 0 for start in starts), "eight worlds are observed together"


def check() -> None:
    test_every_world_is_done_once(3000, 3)


@threaded
@pytest.mark.parametrize("failing", [0, 1])
def test_an_error_propagates_when_no_thread_is_at_work(failing: int) -> None:
    ended = []

    def work(thread: int, first: int, end: int) -> None:
        if thread == failing:
            raise ArithmeticError(f"thread {thread}")
        time.sleep(0.05)
        ended.append(thread)

    with pytest.raises(ArithmeticError, match=f"thread {failing}"):
        over_worlds(work, (), 3000, 4, 2)
    before = list(ended)
    time.sleep(0.1)
    assert ended == before
    check()


@threaded
@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="needs signals of POSIX")
def test_an_interrupt_waits_for_the_threads_wherever_it_comes() -> None:
    """Nothing is written afterwards, and all shares are done, or none."""

    @kernel
    def slow(times: npt.NDArray[np.int64], thread: int, first: int, end: int) -> int:
        for _ in range(300):
            for e in range(first, end):
                times[e] += 1
        return 0

    interrupted, rng = 0, np.random.default_rng(0)
    slow(np.zeros(8, np.int64), 0, 0, 8)
    before = signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(signal.SIGINT))
    interrupts = signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in a shell's background jobs
    gc.disable()  # an exception within a callback of the collector would be lost
    try:
        for _ in range(100):
            times = np.zeros(3000, np.int64)
            try:
                signal.setitimer(signal.ITIMER_REAL, rng.uniform(1e-5, 1e-3))
                over_worlds(slow, (times,), 3000, 4, 3)
                time.sleep(1.0)  # until the alarm, which a busy machine may give late
            except KeyboardInterrupt:
                interrupted += 1
            then = times.copy()
            time.sleep(1e-4)
            np.testing.assert_array_equal(times, then)
            assert set(times) in ({0}, {300})
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
        signal.signal(signal.SIGINT, interrupts)
        gc.enable()
    assert interrupted == 100


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_forked_process_has_threads_of_its_own() -> None:
    check()
    child = os.fork()
    if child == 0:
        try:
            signal.alarm(20)
            check()
            os._exit(0)
        finally:
            os._exit(1)
    assert os.waitpid(child, 0)[1] == 0
    check()
