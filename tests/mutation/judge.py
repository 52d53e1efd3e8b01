"""Whether the fast tests notice a mutant: each is tried in a forked process of its own."""

from __future__ import annotations

import gc
import multiprocessing
import os
import resource
import signal
import sys
import warnings
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Final

import hypothesis
import numpy as np
import pytest
import scipy.optimize  # noqa: F401 (imported once, before the processes fork)
from tests.mutation.uncompiled import import_changed, leave_uncompiled

import posse

TESTS: Final = ("tests/baselines/laws", "tests/baselines/ddcs")
FAST_S: Final = 0.5
"""Processor time within which a test counts as fast, uncompiled."""
LEAST_S: Final = 20.0
"""Processor time that a mutant may take at least; longer than this and 5 times the usual: hangs."""

SURVIVED, KILLED, HUNG = "survived", "killed", "hung"
Times = dict[str, float]
"""Processor time of each fast test, s."""


class _TooSlow(BaseException):
    pass


class _Timed:
    """Times the tests, and gives up those that are not fast."""

    def __init__(self) -> None:
        self.times: Times = {}
        self.failed: list[str] = []
        self.slow: Counter[str] = Counter()

    @pytest.hookimpl(wrapper=True)
    def pytest_pyfunc_call(self, pyfuncitem: pytest.Function) -> Iterator[None]:
        gave_up = False

        def give_up(*_: Any) -> None:
            nonlocal gave_up
            gave_up = True
            raise _TooSlow

        name = pyfuncitem.nodeid.partition("[")[0]
        if self.slow[name] > 1:  # with other parameters
            pytest.skip("not fast")
        signal.signal(signal.SIGPROF, give_up)
        signal.setitimer(signal.ITIMER_PROF, FAST_S)
        try:
            result = yield
        except BaseException:
            if not gave_up:
                raise
            self.slow[name] += 1  # hypothesis may have made another error of it
            return None
        finally:
            left, _ = signal.setitimer(signal.ITIMER_PROF, 0)
        self.times[pyfuncitem.nodeid] = round(FAST_S - left, 3)
        return result

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self.failed.append(report.nodeid)


class _Ordered:
    """Keeps the fast tests, the fastest first."""

    def __init__(self, times: Times) -> None:
        self.times = times

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        kept = [item for item in items if item.nodeid in self.times]
        items[:] = sorted(kept, key=lambda item: (self.times[item.nodeid], item.nodeid))


def _pytest(files: Iterable[str], plugin: object) -> int:
    phases = [hypothesis.Phase.explicit, hypothesis.Phase.generate]  # a failure is not shrunk
    hypothesis.settings.register_profile("mutation", phases=phases, deadline=None)
    hypothesis.settings.load_profile("mutation")
    leave_uncompiled()
    # Each takes a share of the time that a mutant takes.
    plugins = ("cacheprovider", "xdist", "unraisableexception", "hypothesispytest")
    options = ["-q", "-x", "--assert=plain", *(f"-pno:{name}" for name in plugins)]
    return pytest.main([*options, *files], plugins=[plugin])


def _quiet() -> None:
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)


def _time_all(answer: Any) -> None:
    _quiet()
    timed = _Timed()
    _pytest(TESTS, timed)
    answer.send((timed.times, timed.failed))


def _try(module: str, text: str, times: Times, limit: int) -> None:
    _quiet()
    resource.setrlimit(resource.RLIMIT_CPU, (limit, limit))
    sys.dont_write_bytecode = True
    import_changed(module, text)
    room, stem = module.split(".")[1], module.rpartition(".")[2]

    def far(file: str) -> int:
        near = f"/{room}/" in file
        return 2 - near - (near and stem in Path(file).stem)

    # Most are noticed by the tests named as the module; others are collected if need be.
    files = sorted({name.partition("::")[0] for name in times})
    code = 0
    try:
        for away in range(3):
            some = [file for file in files if far(file) == away]
            code = code or (_pytest(some, _Ordered(times)) if some else 0)
    except BaseException:
        code = 1
    os._exit(min(int(code), 1))


def warm_up() -> None:
    """Import what is not mutated, and load the environments' kernels, before processes fork."""
    warnings.simplefilter("ignore", DeprecationWarning)
    batch = posse.batch("constant", 1, message_size=5)
    batch.reset()
    batch.step(np.zeros(batch.action_shape, np.float32))
    gc.freeze()  # what is imported is not searched again in each process


def fast_tests() -> Times:
    """Return the tests that pass in ``FAST_S`` without a mutant.

    Raises:
        RuntimeError: A test fails.
    """
    context = multiprocessing.get_context("fork")
    ours, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_time_all, args=(theirs,))
    process.start()
    theirs.close()
    times, failed = ours.recv()
    process.join()
    if failed:
        raise RuntimeError(f"these tests fail without any mutant: {', '.join(failed)}")
    return dict(times)


def judge(module: str, text: str, times: Times) -> str:
    """Return the outcome of a module's text."""
    limit = int(max(LEAST_S, 5.0 * sum(times.values())))
    arguments = module, text, times, limit
    process = multiprocessing.get_context("fork").Process(target=_try, args=arguments)
    process.start()
    process.join()
    if process.exitcode == 0:
        return SURVIVED
    return KILLED if process.exitcode == 1 else HUNG
