"""Environments in mid-episode that are pickled, forked, sent to spawned and forkserver processes.

Run it for as long as you like::

    python -m tests.fuzz.processes --minutes 30 --seed 1

Whatever way an environment went, it goes on as the original does: everything that it holds is
equal, field by field, after some more steps.
"""

from __future__ import annotations

import functools
import multiprocessing
import pickle
import random
import warnings
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from tests.fuzz.campaign import main
from tests.support.adapters import out_of_band
from tests.support.attack import MAKERS, Subject, unchanged

KINDS = tuple(kind for kind in MAKERS if kind != "torchrl")
LIMIT_S = 120


def go_on(subject: Subject, seed: int, steps: int) -> list[Any]:
    """Take steps, begin anew where an episode ends; return what the environment then holds."""
    rng = np.random.default_rng(seed)
    for _ in range(steps):
        try:
            subject.step(subject.good_action(rng))
        except ResetNeeded:
            subject.reset()
    return subject.held()


def in_band(subject: Subject, seed: int, steps: int) -> list[Any]:
    return go_on(pickle.loads(pickle.dumps(subject)), seed, steps)  # noqa: S301


def beside(subject: Subject, seed: int, steps: int) -> list[Any]:
    return go_on(out_of_band(subject), seed, steps)


def forked(subject: Subject, seed: int, steps: int) -> list[Any]:
    context = multiprocessing.get_context("fork")
    here, there = context.Pipe()

    def child() -> None:
        there.send(go_on(subject, seed, steps))

    with warnings.catch_warnings():
        # Newer Pythons warn of a fork where there are threads: that is what is tried.
        warnings.simplefilter("ignore", DeprecationWarning)
        process = context.Process(target=child)
        process.start()
    try:
        assert here.poll(LIMIT_S), "the forked process hangs"
        held: list[Any] = here.recv()
        return held
    finally:
        process.kill()
        process.join()


@functools.cache
def _worker(method: str) -> ProcessPoolExecutor:
    return ProcessPoolExecutor(1, mp_context=multiprocessing.get_context(method))


def spawned(subject: Subject, seed: int, steps: int) -> list[Any]:
    return _worker("spawn").submit(go_on, subject, seed, steps).result(LIMIT_S)


def of_a_server(subject: Subject, seed: int, steps: int) -> list[Any]:
    return _worker("forkserver").submit(go_on, subject, seed, steps).result(LIMIT_S)


WAYS = (in_band, beside, forked, spawned, of_a_server)


def case(seed: int, number: int) -> None:
    """Send one environment one way."""
    rng = random.Random(f"{seed} {number}")
    subject = Subject(rng.choice(KINDS))
    subject.reset(seed=rng.randrange(2**63))
    go_on(subject, rng.randrange(2**32), rng.randrange(7))
    way, draws, steps = rng.choice(WAYS), rng.randrange(2**32), rng.randrange(1, 10)
    elsewhere = way(subject, draws, steps)
    assert unchanged(go_on(subject, draws, steps), elsewhere), f"{subject.kind} {way.__name__}"


if __name__ == "__main__":
    main(__doc__, case)
