"""``make bench-costs``: time of each phase of a step, and how it grows with size.

One thread throughout; each figure is the minimum of many runs, since other load only adds to it.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import machine
import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

import posse
from posse.engine import kernels as world
from posse.engine.scratch import SCRATCH
from posse.numeric import kernel
from posse.rules import contact, motion, score
from posse.rules import discs as survey
from posse.rules.discs import lay_out_constants
from posse.rules.scratch import new_scratch
from posse.signals.generate import declarations_for, generated_for
from posse.signals.observation import observing

PARTS = (
    "motion",
    "positions and distances of discs",
    "contact",
    "target sensor and radio",
    "score",
    "metrics",
    "reward",
    "observations",
)


@dataclass(frozen=True)
class Settings:
    """Command-line arguments."""

    seconds: float = 0.5
    """Time per figure."""
    scenarios: tuple[str, ...] = ("smart", "field")
    """Scenarios to profile."""
    team_sizes: tuple[int, ...] = (2, 3, 5, 8, 16, 32, 64)
    obstacles: tuple[int, ...] = (0, 2, 4, 8, 16, 32)
    worlds: tuple[int, ...] = (1, 8, 64, 512, 4096, 16_384, 65_536)
    out: Path = Path("runs/bench/costs.json")


MADE = generated_for(declarations_for(posse.get_scenario("constant")))


@kernel
def one_part(  # type: ignore[no-untyped-def]
    part, tables, worlds, actions, results, memory
):
    """Execute one part of a step in every world."""
    scratch = memory[0]
    lay_out_constants(tables.config[0], tables.beams, scratch)
    c, observations = tables.config[0], results.observations
    for e in range(len(worlds.world)):
        w, t, o = worlds.world[e], worlds.tracker[e], worlds.obstacle[e]
        if part == 0:
            motion.motion(c, w, t, o, actions[e], MADE.set_goal, scratch)
            continue
        survey.lay_out(c, w, t, o, scratch)  # input of the other parts
        survey.find_gaps(c, scratch)
        if part == 2:
            contact.meet(c, w, t, o, scratch)
        elif part == 3:
            w.step += 1
            world.sense(c, worlds, e, MADE, scratch)
        elif part == 4:
            score.occupy(c, w, t, tables.slots, scratch)
        elif part == 5:
            MADE.add_to_sums(c, w, t, tables.slots)
            score.settle(c, w)
        elif part == 6:
            world.reward(c, w, t, tables, MADE, results.rewards[e], results.terms[e])
        elif part == 7:
            observing.observe_sonar(c, w, t, scratch, observations[e], MADE.width)
            begun = e % observing.TOGETHER + 1
            if begun == observing.TOGETHER or e == len(worlds.world) - 1:
                observing.observe_together(c, worlds, e + 1 - begun, begun, MADE, scratch, observations)


def best(call: Callable[[], object], seconds: float) -> float:
    """Return the least time of a call, s."""
    call()
    least, started = float("inf"), time.perf_counter()
    while time.perf_counter() - started < seconds:
        before = time.perf_counter()
        call()
        least = min(least, time.perf_counter() - before)
    return least


def moving(scenario: str, count: int, **overrides: Any) -> tuple[posse.Batch, Any]:
    """Return worlds in mid-episode, and actions for them."""
    batch = posse.batch(scenario, count, num_threads=1, horizon=15_000, **overrides)
    batch.reset(seed=0)
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1, 1, batch.action_shape).astype(np.float32)
    for _ in range(50):
        batch.step(actions)
    return batch, actions


def parts(scenario: str, seconds: float) -> dict[str, float]:
    """Return the time of each part of a step per tracker, ns; ``"step"`` is the whole."""
    batch, actions = moving(scenario, 256)
    agents = batch.num_worlds * batch.scenario.num_trackers
    observations = np.empty(batch.observation_shape, np.float32)
    rewards = np.empty(batch.observation_shape[:2], np.float32)
    terms = np.empty((*rewards.shape, len(posse.REWARD_TERMS)), np.float32)
    advance = batch.stepper(actions, observations, rewards, terms)
    flags = np.empty((2, batch.num_worlds), np.bool_)
    results = world.Results(observations, rewards, terms, flags)
    memory = new_scratch(SCRATCH)
    arguments = (batch._tables, batch.arrays, actions, results, memory)
    costs = {"step": best(advance, seconds) / agents * 1e9}
    snapshot = batch.save()
    for number, name in enumerate(PARTS):
        batch.restore(snapshot)
        took = best(partial(one_part, number, *arguments), seconds)
        costs[name] = took / agents * 1e9
        if number > 1:
            costs[name] -= costs[PARTS[1]]
    return costs


def whole(scenario: str, count: int, seconds: float, **overrides: Any) -> float:
    """Return the time of a step per tracker, ns."""
    batch, actions = moving(scenario, count, **overrides)
    agents = count * batch.scenario.num_trackers
    return best(lambda: batch.step(actions), seconds) / agents * 1e9


def main() -> None:
    """Measure, print, and write the figures."""
    s = tyro.cli(Settings)
    others, own = machine.OtherWork(), time.process_time()
    figures: dict[str, Any] = {"machine": machine.describe()}
    figures["parts"] = {name: parts(name, s.seconds) for name in s.scenarios}
    figures["team_size"] = {
        n: whole("smart", max(1, 4096 // n), s.seconds, num_trackers=n, formation="ring") for n in s.team_sizes
    }
    figures["obstacles"] = {m: whole("obstacles", 1024, s.seconds, num_obstacles=m, arena=40.0) for m in s.obstacles}
    figures["worlds"] = {e: whole("smart", e, s.seconds) for e in s.worlds}
    figures["cores_busy_with_other_work"] = others.cores(time.process_time() - own)
    console = Console()
    for title, column, rows in (
        *((f"a step of {name} by part", "part", figures["parts"][name]) for name in s.scenarios),
        ("smart, by team size (at most 8 nearest team-mates)", "trackers", figures["team_size"]),
        ("obstacles, by number of obstacles", "obstacles", figures["obstacles"]),
        ("smart, by number of worlds", "worlds", figures["worlds"]),
    ):
        table = Table(title=title)
        table.add_column(column)
        table.add_column("ns a tracker", justify="right")
        for key, nanoseconds in rows.items():
            table.add_row(f"{key:,}" if isinstance(key, int) else key, f"{nanoseconds:,.0f}")
        console.print(table)
    busy = figures["cores_busy_with_other_work"]
    console.print(f"cores used by other processes meanwhile: {busy:.2f}")
    s.out.parent.mkdir(parents=True, exist_ok=True)
    s.out.write_text(json.dumps(figures, indent=2) + "\n")
    console.print(f"figures: {s.out}")


if __name__ == "__main__":
    main()
