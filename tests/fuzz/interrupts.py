"""Interrupt steps of a batch at random moments: nothing is half done, or written afterwards.

Run it for as long as you like::

    python -m tests.fuzz.interrupts --minutes 30 --seed 1

Each case sets a timer, whose signal raises KeyboardInterrupt, once or many times in a row, while
4,096 worlds are stepped by two threads. Then the worlds have to be just as before the step or as
after it, step on as a batch that was never interrupted, and come back from a snapshot.
"""

from __future__ import annotations

import argparse
import random
import signal
import sys
import threading
import time
from collections import Counter
from dataclasses import dataclass
from types import FrameType
from typing import Any

import numpy as np
import numpy.typing as npt

import posse

WORLDS = 4096
Floats = npt.NDArray[np.float32]


@dataclass
class Alarm:
    """A signal handler that raises so many times, where it interrupts a batch's step."""

    left: int = 0

    def __call__(self, number: int, frame: FrameType | None) -> None:
        while frame is not None and frame.f_code is not posse.Batch.step.__code__:
            frame = frame.f_back
        if self.left > 0 and frame is not None:
            self.left -= 1
            raise KeyboardInterrupt


def workers() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "posse"]


def state_of(batch: posse.Batch) -> bytes:
    return b"".join(np.ascontiguousarray(view).tobytes() for view in batch.state.values())


def interrupted_step(batch: posse.Batch, actions: Floats, timer: Any) -> bool:
    """Step; return whether an interrupt came out of it."""
    signal.setitimer(signal.ITIMER_REAL, *timer)
    try:
        batch.step(actions)
    except KeyboardInterrupt:
        return True
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
    return False


def campaign(seed: int, cases: int = 10**9, seconds: float = 10**9) -> tuple[Counter[str], list[str]]:
    """Play cases from a seed, until there were enough; return how many ended how, and failures."""
    rng = random.Random(seed)
    batch = posse.batch("smart", WORLDS, seed=seed, num_threads=2)
    twin = posse.batch("smart", WORLDS, seed=seed, num_threads=1)
    for each in (batch, twin):
        each.reset()
    numbers = np.random.default_rng(seed)
    actions: Floats = numbers.uniform(-1, 1, (2, *batch.action_shape)).astype(np.float32)
    batch.step(actions[0])
    twin.step(actions[0])

    snapshot = batch.save()
    observed = batch.restore(snapshot)
    before = state_of(batch)
    began = time.perf_counter()
    for _ in range(10):
        batch.step(actions[0])
        batch.restore(snapshot)
    step = (time.perf_counter() - began) / 20

    # What an undisturbed batch comes to: after the step, and after one more.
    first = twin.step(actions[0])
    after = state_of(twin)
    second = twin.step(actions[1])
    of_second = {before: first, after: second}

    most = len(workers())
    alarm, counts, failures = Alarm(), Counter[str](), []
    previous = signal.signal(signal.SIGALRM, alarm)
    end = time.monotonic() + seconds
    try:
        for case in range(cases):
            if time.monotonic() > end:
                break
            burst = rng.random() < 0.3
            alarm.left = rng.randrange(2, 10) if burst else 1
            delay = rng.uniform(0.0, 1.5) * step + 1e-6
            timer = (delay, rng.choice((1e-4, 5e-4))) if burst else (delay,)
            interrupted = interrupted_step(batch, actions[0], timer)
            counts["interrupted" if interrupted else "not interrupted"] += 1
            reached = state_of(batch)
            name = f"seed {seed}, case {case}"
            if reached not in (before, after) or (not interrupted and reached != after):
                failures.append(f"{name}: the step is half done")
            else:
                counts["done" if reached == after else "not begun"] += interrupted
                number = 0 if reached == before else 1
                results = batch.step(actions[number])
                expected = of_second[reached]
                if not all(map(np.array_equal, results[:4], expected[:4])):
                    failures.append(f"{name}: the next step gives other results")
            again = batch.restore(snapshot)
            if rng.random() < 0.2:
                time.sleep(0.002)  # whoever still writes shows
            if not np.array_equal(again, observed) or state_of(batch) != before:
                failures.append(f"{name}: restored to something else")
            if len(workers()) > most:
                time.sleep(0.1)  # one that has ended its work may not be gone yet
                if len(workers()) > most:
                    failures.append(f"{name}: {len(workers())} threads, not {most}")
    finally:
        signal.signal(signal.SIGALRM, previous)
    return counts, failures


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    counts, failures = campaign(chosen.seed, seconds=60 * chosen.minutes)
    sys.stdout.write("\n".join([*failures, f"{dict(counts)}", ""]))
    sys.exit(bool(failures))


if __name__ == "__main__":
    main()
