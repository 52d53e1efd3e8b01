"""``make bench``: throughput on this machine.

Agent-steps/s of batches, compared with a plain copy of the observations; steps/s of single-world
environments, alone and with other busy processes; time of the first step of a new process.
"""

from __future__ import annotations

import itertools
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import machine
import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

import posse

FIRST_STEP = (
    "import gymnasium, posse; "
    "env = gymnasium.make('posse/Team-v0', scenario='smart'); "
    "env.reset(seed=0); env.step(env.action_space.sample())"
)
# Ends with its parent process, so that it does not disturb later measurements.
BUSY = "import os; parent = os.getppid()\nwhile os.getppid() == parent: sum(range(1000))"


@dataclass(frozen=True)
class Settings:
    """Command-line arguments."""

    scenario: str = "smart"
    overrides: dict[str, int] = field(default_factory=dict)
    """Integer settings that override those of the scenario."""
    worlds: tuple[int, ...] | None = None
    """Numbers of worlds; default: 1 to 16,384."""
    seconds: float = 1.0
    """Total time of the five runs of each figure, s."""
    cold: bool = True
    """Also time the first step of a new process, without and with cached kernels."""
    out: Path = Path("runs/bench/speed.json")


def per_second(step: Callable[[], object], seconds: float) -> list[float]:
    """Return calls per second: median, least and greatest of five runs."""
    step()
    started = time.perf_counter()
    step()
    # Reading the clock takes time, too: once per millisecond suffices.
    together = 1 + int(1e-3 / max(time.perf_counter() - started, 1e-6))
    rates = []
    for _ in range(5):
        calls, started = 0, time.perf_counter()
        while time.perf_counter() - started < seconds / 5 or calls < 3:
            for _ in range(together):
                step()
            calls += together
        rates.append(calls / (time.perf_counter() - started))
    return [statistics.median(rates), min(rates), max(rates)]


def batches(settings: Settings) -> list[dict[str, Any]]:
    """Measure batches with one thread and with all, and a plain copy of their observations."""
    rows = []
    kinds = itertools.product(settings.worlds or (1, 32, 1024, 4096, 16384), sorted({1, os.cpu_count() or 1}))
    for count, threads in kinds:
        batch = posse.batch(settings.scenario, count, num_threads=threads, **dict[str, Any](settings.overrides))
        observations = batch.reset(seed=0)
        rng = np.random.default_rng(0)
        actions = rng.uniform(-1, 1, batch.action_shape).astype(np.float32)
        copy = np.empty_like(observations)
        agents = observations.shape[0] * observations.shape[1]
        rate = per_second(partial(batch.step, actions), settings.seconds)
        plain = per_second(partial(np.copyto, copy, observations), settings.seconds)
        rows.append(
            {
                "worlds": count,
                "threads": threads,
                "agent_steps": [r * agents for r in rate],
                "copies": [r * agents for r in plain],
                "times_a_copy": plain[0] / rate[0],
                "observation_length": observations.shape[2],
                "bytes_a_world": batch.bytes_per_world,
            }
        )
    return rows


def interfaces(settings: Settings) -> dict[str, list[float]]:
    """Measure steps per second of single-world environments, including dictionaries and checks."""
    parallel = posse.parallel_env(settings.scenario, horizon=4_000)
    parallel.reset(seed=0)
    rng = np.random.default_rng(0)
    actions = {agent: rng.uniform(-1, 1, 2).astype(np.float32) for agent in parallel.possible_agents}

    def step() -> None:
        parallel.step(actions)
        if not parallel.agents:
            parallel.reset()

    team = team_step(settings.scenario, np.stack(list(actions.values())))
    return {
        "PettingZoo parallel": per_second(step, settings.seconds),
        "Gymnasium Team": per_second(team, settings.seconds),
    }


def team_step(scenario: str, action: Any) -> Callable[[], None]:
    """Return a function that steps one world through Gymnasium."""
    env: Any = gym.make("posse/Team-v0", scenario=scenario, horizon=4_000).unwrapped
    env.reset(seed=0)

    def step() -> None:
        _, _, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            env.reset()

    return step


@dataclass
class Pace:
    """Count and time of a repeated function."""

    calls: int = 0
    seconds: float = 0.0
    processor: float = 0.0
    """Processor time of the thread, s."""

    def work(self, step: Callable[[], object], seconds: float) -> None:
        """Repeat for a time."""
        started, had = time.perf_counter(), time.thread_time()
        while time.perf_counter() - started < seconds:
            for _ in range(10):
                step()
            self.calls += 10
        self.seconds += time.perf_counter() - started
        self.processor += time.thread_time() - had

    def beside(self, alone: Pace) -> dict[str, float]:
        """Return its speed relative to running alone, by wall time and by processor time."""
        return {
            "share": self.calls / self.seconds / (alone.calls / alone.seconds),
            "of_the_processor": self.calls / self.processor / (alone.calls / alone.processor),
        }


def beside_others(settings: Settings) -> dict[str, dict[str, dict[str, float]]]:
    """Return the speed of a single world with other busy processes, relative to running alone.

    Alternating every 10 ms with a plain loop as a reference, since clock rate and scheduling
    depend on the load.
    """
    still = np.zeros((posse.get_scenario(settings.scenario).num_trackers, 2), np.float32)
    work: dict[str, Callable[[], object]] = {
        "one world": team_step(settings.scenario, still),
        "a plain loop": lambda: sum(range(1000)),
    }

    def paces() -> dict[str, Pace]:
        found = {name: Pace() for name in work}
        for name, step in list(work.items()) * max(1, round(50 * settings.seconds)):
            found[name].work(step, 0.01)
        return found

    shares = {}
    for count in sorted({1, os.cpu_count() or 1}):
        rounds = []
        for _ in range(5):
            alone = paces()
            busy = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in range(count)]
            time.sleep(0.2)  # until they are busy
            try:
                beside = paces()
            finally:
                for process in busy:
                    process.kill()
                    process.wait()
            rounds.append({name: beside[name].beside(alone[name]) for name in work})
        shares[str(count)] = {
            name: {kind: statistics.median(r[name][kind] for r in rounds) for kind in ("share", "of_the_processor")}
            for name in work
        }
    return shares


def first_steps() -> dict[str, float]:
    """Return seconds from the start of a process to its first step, without and with cache."""
    seconds = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in ("cold", "warm"):
            started = time.perf_counter()
            subprocess.run(
                [sys.executable, "-c", FIRST_STEP], check=True, env={**os.environ, "POSSE_CACHE_DIR": folder}
            )
            seconds[name] = time.perf_counter() - started
    return seconds


def main() -> None:
    """Measure, print, and write the figures."""
    settings = tyro.cli(Settings)
    others = machine.OtherWork()
    own = time.process_time()
    rows, single = batches(settings), interfaces(settings)
    disturbed = others.cores(time.process_time() - own)
    figures: dict[str, Any] = {
        "machine": machine.describe(),
        "scenario": settings.scenario,
        "overrides": settings.overrides,
        "batches": rows,
        "one_world": single,
        "cores_busy_with_other_work": disturbed,
    }
    figures["beside_busy_processes"] = beside_others(settings)
    if settings.cold:
        figures["first_step_seconds"] = first_steps()
    console = Console()
    length, size = rows[0]["observation_length"], rows[0]["bytes_a_world"]
    table = Table(title=f"{settings.scenario}: {length} floats an observation, {size} bytes a world")
    for column in ("worlds", "threads", "million agent-steps/s [range]", "times a plain copy"):
        table.add_column(column, justify="right")
    for row in rows:
        median, low, high = (x / 1e6 for x in row["agent_steps"])
        table.add_row(
            f"{row['worlds']:,}",
            str(row["threads"]),
            f"{median:.2f} [{low:.2f}, {high:.2f}]",
            f"{row['times_a_copy']:.1f}",
        )
    console.print(table)
    for name, (median, low, high) in single.items():
        console.print(f"{name}: {median:,.0f} steps/s [{low:,.0f}, {high:,.0f}], one world")
    for count, shares in figures["beside_busy_processes"].items():
        fair = min(1.0, (os.cpu_count() or 1) / (int(count) + 1))
        console.print(
            f"with other busy processes, {count}, relative to the speed alone: "
            + ", ".join(
                f"{name} {s['share']:.2f} ({s['of_the_processor']:.2f} per second of processor)"
                for name, s in shares.items()
            )
            + f"; share of the cores: {fair:.2f}"
        )
    for name, seconds in figures.get("first_step_seconds", {}).items():
        console.print(f"first step of a new process, {name}: {seconds:.1f} s")
    console.print(f"cores used by other processes meanwhile: {disturbed:.2f}")
    settings.out.parent.mkdir(parents=True, exist_ok=True)
    settings.out.write_text(json.dumps(figures, indent=2) + "\n")
    console.print(f"figures: {settings.out}")


if __name__ == "__main__":
    main()
