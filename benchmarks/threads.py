"""Own threads compared with a pool of the standard library, interleaved in one run.

Both call the same compiled kernel on the same blocks of worlds; only the hand-over differs. Steps
alone, steps behind a torch policy (a shared network of 64 x 64, torch's own threads), and an
evaluation of a scripted team.

    python benchmarks/threads.py
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any
from unittest import mock

import numpy as np
import torch
import tyro
from rich.console import Console
from rich.table import Table

import posse
import posse.engine.batch
import posse.numeric.threads
from posse.numeric import divide, run_threads
from posse_baselines import begin, load


@dataclass(frozen=True)
class Settings:
    """Command-line arguments."""

    scenario: str = "smart"
    worlds: tuple[int, ...] = (500, 1024, 4096, 16384)
    threads: int = 2
    pairs: int = 30
    """Pairs of runs of each figure."""
    seconds: float = 0.1
    """Length of a run, s."""


POOL = ThreadPoolExecutor(max_workers=64)


def pooled(work: Callable[[int, Any], Any], num_worlds: int, threads: int) -> list[Any]:
    """Call ``work(thread, blocks)`` as ``posse.numeric.run_threads`` does, on the pool."""
    if threads == 1:
        return [work(0, divide(num_worlds, 1))]
    blocks = divide(num_worlds, threads).copy()
    waiting = [POOL.submit(work, thread, blocks) for thread in range(1, threads)]
    return [work(0, blocks), *(each.result() for each in waiting)]


def steps(s: Settings, worlds: int) -> Callable[[], object]:
    """Return a step with random actions."""
    batch = posse.batch(s.scenario, worlds, num_threads=s.threads)
    batch.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1, 1, batch.action_shape).astype(np.float32)
    return lambda: batch.step(actions)


def behind_torch(s: Settings, worlds: int) -> Callable[[], object]:
    """Return a step with the actions of a network."""
    batch = posse.batch(s.scenario, worlds, num_threads=s.threads)
    latest = [batch.reset(seed=0)]
    length, actions = latest[0].shape[-1], batch.action_shape[-1]
    layers = [torch.nn.Linear(length, 64), torch.nn.Tanh(), torch.nn.Linear(64, 64)]
    network = torch.nn.Sequential(*layers, torch.nn.Tanh(), torch.nn.Linear(64, actions))

    def step() -> None:
        with torch.no_grad():
            chosen = torch.tanh(network(torch.from_numpy(latest[0]))).numpy()
        latest[0] = batch.step(chosen)[0]

    return step


def evaluated(s: Settings, worlds: int) -> Callable[[], object]:
    """Return a step of a scripted team."""
    policy = load("ddcs-distributed")
    batch = posse.batch(s.scenario, worlds, num_threads=s.threads, message_size=policy.message_size)
    latest = [batch.reset(seed=0)]
    memory = begin(policy, batch)

    def step() -> None:
        actions, _ = policy.act(latest[0], memory)
        latest[0] = batch.step(actions)[0]

    return step


def rate(step: Callable[[], object], seconds: float, pool: bool) -> float:
    """Return steps per second, with the pool or with our own threads."""
    chosen = pooled if pool else run_threads
    with (
        mock.patch.object(posse.engine.batch, "run_threads", chosen),
        # Used by scripted policies, through over_worlds.
        mock.patch.object(posse.numeric.threads, "run_threads", chosen),
    ):
        step()
        count, started = 0, time.perf_counter()
        while time.perf_counter() - started < seconds:
            step()
            count += 1
    return count / (time.perf_counter() - started)


def main() -> None:
    """Measure and print."""
    s = tyro.cli(Settings, description=__doc__)
    table = Table("", "worlds", "own threads, steps/s", "pool, steps/s", "pool / own [quartiles]")
    kinds = {"steps": steps, "behind a torch policy": behind_torch, "scripted team": evaluated}
    for name, make in kinds.items():
        for worlds in s.worlds:
            step = make(s, worlds)
            pairs = [(rate(step, s.seconds, False), rate(step, s.seconds, True)) for _ in range(s.pairs)]
            own, pool = (statistics.median(side) for side in zip(*pairs, strict=True))
            low, middle, high = statistics.quantiles([b / a for a, b in pairs], n=4)
            table.add_row(name, f"{worlds:,}", f"{own:,.0f}", f"{pool:,.0f}", f"{middle:.2f} [{low:.2f}, {high:.2f}]")
    Console(width=None if sys.stdout.isatty() else 120).print(table)


if __name__ == "__main__":
    main()
