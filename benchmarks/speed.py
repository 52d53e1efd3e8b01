"""``make bench``: throughput on this machine.

Agent-steps/s of batches, steps/s of single-world environments, and the time of the first step of a new process
without and with cached kernels. Median, least and greatest of five runs each. ``--against PATH`` compares with another
checkout instead.
"""

import datetime as dt
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import gymnasium as gym
import numpy as np
import tyro

import posse
from posse_training.provenance import commit

FIRST_STEP = (
    "import gymnasium, posse; "
    "env = gymnasium.make('posse/Team-v0', scenario='smart'); "
    "env.reset(seed=0); env.step(env.action_space.sample())"
)


@dataclass(frozen=True)
class Settings:
    """Command-line arguments."""

    scenario: str = "smart"
    changes: Annotated[tuple[str, ...], tyro.conf.arg(name="set", metavar="KEY=NUMBER ...")] = ()
    """Settings of the scenario to change, whole numbers."""
    worlds: tuple[int, ...] = (1, 32, 1024, 4096, 16384)
    seconds: float = 1.0
    """Total time of the five runs of each figure, s."""
    cold: bool = True
    """Also time the first step of a new process, without and with cached kernels."""
    against: Path | None = None
    """Another checkout of posse: measure both in turns, and print this one's figures divided by the other's."""
    starts: int = 7
    """Processes of each, with ``against``."""
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
    return _spread(rates)


def batches(settings: Settings) -> list[dict[str, Any]]:
    """Measure batches with one thread and with all."""
    rows = []
    for count in settings.worlds:
        for threads in sorted({1, os.cpu_count() or 1}):
            changes: dict[str, Any] = {key: int(text) for key, text in (word.split("=") for word in settings.changes)}
            batch = posse.batch(settings.scenario, count, num_threads=threads, **changes)
            batch.reset(seed=0)
            actions = np.random.default_rng(0).uniform(-1, 1, batch.action_shape).astype(np.float32)
            agents = actions.shape[0] * actions.shape[1]
            rate = [calls * agents for calls in per_second(partial(batch.step, actions), settings.seconds)]
            rows.append({"worlds": count, "threads": threads, "agent_steps": rate})
            print(f"{count:6,} worlds, {threads} threads: {_shown(rate)} agent-steps/s", flush=True)
    return rows


def one_world(settings: Settings) -> dict[str, list[float]]:
    """Measure steps/s of the environments of one world, resets included."""
    parallel = posse.parallel_env(settings.scenario)
    parallel.reset(seed=0)
    actions = {agent: parallel.action_space(agent).sample() for agent in parallel.possible_agents}
    team = gym.make("posse/Team-v0", scenario=settings.scenario)
    team.reset(seed=0)
    action = team.action_space.sample()

    def step_parallel() -> None:
        parallel.step(actions)
        if not parallel.agents:
            parallel.reset()

    def step_team() -> None:
        *_, terminated, truncated, _ = team.step(action)
        if terminated or truncated:
            team.reset()

    found = {}
    for name, step in (("PettingZoo", step_parallel), ("Gymnasium Team", step_team)):
        found[name] = per_second(step, settings.seconds)
        print(f"{name}, one world: {_shown(found[name])} steps/s", flush=True)
    return found


def first_step() -> dict[str, float]:
    """Time the first step of a new process, s, without and with cached kernels."""
    found = {}
    with tempfile.TemporaryDirectory() as cache:
        for name in ("without cached kernels", "with cached kernels"):
            started = time.perf_counter()
            subprocess.run([sys.executable, "-c", FIRST_STEP], check=True, env={**os.environ, "POSSE_CACHE_DIR": cache})
            found[name] = time.perf_counter() - started
            print(f"first step of a new process, {name}: {found[name]:.1f} s", flush=True)
    return found


def compare(settings: Settings, other: Path) -> None:
    """Measure another checkout and this one in new processes, in turns; print a table of figures and ratios."""
    command = [sys.executable, __file__, "--scenario", settings.scenario, "--seconds", str(settings.seconds)]
    command += ["--worlds", *map(str, settings.worlds), "--cold" if settings.cold else "--no-cold"]
    command += ["--set", *settings.changes] if settings.changes else []
    roots = (other.resolve(), Path(__file__).resolve().parents[1])
    found: tuple[list[dict[str, float]], ...] = ([], [])
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "figures.json")
        for _ in range(settings.starts):
            for root, figures in zip(roots, found, strict=True):
                sources = os.pathsep.join(str(root / name) for name in ("envs", "baselines", "training"))
                environment = {**os.environ, "PYTHONPATH": sources}
                subprocess.run([*command, "--out", file], check=True, env=environment, stdout=subprocess.DEVNULL)
                figures.append(_named(json.loads(file.read_text(encoding="utf-8"))))
    print("| figure | other | this | ratio: median [least, greatest] |\n|---|---|---|---|")
    for name in found[0][0]:
        theirs, ours = ([figures[name] for figures in each] for each in found)
        ratios = [mine / yours for mine, yours in zip(ours, theirs, strict=True)]
        medians = [f"{statistics.median(each):,.4g}" for each in (theirs, ours)]
        print("|", name, "|", " | ".join(medians), "| {:.2f} [{:.2f}, {:.2f}] |".format(*_spread(ratios)))


def _named(figures: dict[str, Any]) -> dict[str, float]:
    """Return the figures of a run by name."""
    return {
        **{f"{r['worlds']:,} worlds, {r['threads']} threads": r["agent_steps"][0] for r in figures["batches"]},
        **{f"{name}, one world": rate[0] for name, rate in figures["one_world"].items()},
        **{f"first step {name}, s": each for name, each in figures.get("first_step_seconds", {}).items()},
        "load average": max(figures["machine"]["load_average"], 0.01),
    }


def _spread(values: list[float]) -> list[float]:
    return [statistics.median(values), min(values), max(values)]


def _shown(rate: list[float]) -> str:
    return "{:,.0f} [{:,.0f}, {:,.0f}]".format(*rate)


def describe() -> dict[str, Any]:
    """Return machine, date and commit."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "memory_gib": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "date": dt.date.today().isoformat(),
        "commit": commit(),
        "load_average": os.getloadavg()[0],
    }


def _processor() -> str:
    file = Path("/proc/cpuinfo")  # of Linux alone
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    return next((line.split(": ", 1)[1] for line in lines if line.startswith("model name")), platform.machine())


def main() -> None:
    """Measure, print and write the figures."""
    settings = tyro.cli(Settings, description=__doc__)
    if settings.against is not None:
        compare(settings, settings.against)
        return
    figures: dict[str, Any] = {"machine": describe()}
    figures["batches"], figures["one_world"] = batches(settings), one_world(settings)
    if settings.cold:
        figures["first_step_seconds"] = first_step()
    settings.out.parent.mkdir(parents=True, exist_ok=True)
    settings.out.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
