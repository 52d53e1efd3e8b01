"""Eight Python threads at once, each with a batch or an environment of its own.

Run it for as long as you like::

    python -m tests.fuzz.threads --minutes 30 --seed 1

Every thread comes to what it comes to alone, field by field: small batches and such as are stepped
by several threads, policies, environments of all kinds, made, reset, saved and restored in between.
"""

from __future__ import annotations

import random
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
from tests.fuzz.campaign import main
from tests.fuzz.processes import KINDS, go_on
from tests.support.adapters import same
from tests.support.attack import Subject

import posse
from posse_baselines import load

THREADS = 8
LIMIT_S = 120.0
POLICIES = ("pursuit", "ddcs-distributed", "learned-smart")
Play = Callable[[], Any]


def of_batch(rng: random.Random) -> Play:
    """Return what steps a batch by drawn actions; large ones are stepped by several threads."""
    scenario, worlds = rng.choice(posse.scenario_names()), rng.choice((1, 7, 64, 700))
    threads, seed, steps = rng.randint(1, 4), rng.randrange(2**63), rng.randint(1, 12)

    def play() -> Any:
        batch = posse.batch(scenario, worlds, seed=seed, num_threads=threads)
        draws, found = np.random.default_rng(seed), [batch.reset()]
        for step in range(steps):
            if step == steps // 2:
                batch.restore(batch.save())
            actions = draws.uniform(-1, 1, batch.action_shape).astype(np.float32)
            observations, rewards, *_ = batch.step(actions)
            found += [observations.copy(), rewards.copy()]
        return found, {name: array.copy() for name, array in batch.state.items()}

    return play


def of_policy(rng: random.Random) -> Play:
    """Return what plays a policy."""
    name, seed = rng.choice(POLICIES), rng.randrange(2**63)
    worlds, steps = rng.choice((1, 40, 600)), rng.randint(1, 8)

    def play() -> Any:
        policy = load(name)
        batch = posse.batch("smart", worlds, seed=seed, message_size=policy.message_size)
        observations, found = batch.reset(), []
        memory = policy.begin(batch.layout, worlds)
        for _ in range(steps):
            actions, memory = policy.act(observations, memory)
            observations, *_ = batch.step(actions)
            found += [actions.copy(), observations.copy()]
        return found

    return play


def of_environment(rng: random.Random) -> Play:
    """Return what plays an environment of any kind over the ends of episodes."""
    kind, seed, draws = rng.choice(KINDS), rng.randrange(2**63), rng.randrange(2**32)
    steps = rng.randint(1, 20)

    def play() -> Any:
        subject = Subject(kind)
        subject.reset(seed=seed)
        return go_on(subject, draws, steps)

    return play


def case(seed: int, number: int) -> None:
    """Play eight drawn things one after the other, then at once."""
    rng = random.Random(f"{seed} {number}")
    plays = [rng.choice((of_batch, of_policy, of_environment))(rng) for _ in range(THREADS)]
    alone = [play() for play in plays]
    found: list[Any] = [None] * THREADS
    start = threading.Barrier(THREADS)

    def at_once(k: int) -> None:
        start.wait(LIMIT_S)
        try:
            found[k] = plays[k]()
        except BaseException as error:
            found[k] = error

    threads = [threading.Thread(target=at_once, args=(k,), daemon=True) for k in range(THREADS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(LIMIT_S)
        assert not thread.is_alive(), "hangs"
    for play, one, other in zip(plays, alone, found, strict=True):
        if isinstance(other, BaseException):
            raise other
        assert same(one, other), f"{play.__qualname__} differs from the same alone"


if __name__ == "__main__":
    main(__doc__, case)
