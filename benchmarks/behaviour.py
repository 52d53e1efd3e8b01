"""Behaviour of teams after their arrival, for that section of docs/comparison.md."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

import posse
from posse.scenarios.formation import slot_offsets
from posse_baselines import begin, load


@dataclass(frozen=True)
class Settings:
    """Policies and scenario."""

    policies: Annotated[tuple[str, ...], tyro.conf.Positional] = (
        "ddcs-distributed", "planner", "learned-smart",
    )  # fmt: skip
    scenario: str = "smart"
    worlds: int = 200
    seed: int = 3
    split: str = "validation"
    after: float = 20.0
    """Time before the measurement starts, s."""


def look(name: str, s: Settings) -> dict[str, float]:
    """Return means over trackers, worlds and steps after the arrival."""
    policy = load(name)
    batch = posse.batch(
        s.scenario, s.worlds, seed=s.seed, split=s.split, message_size=policy.message_size
    )
    scenario, trackers, worlds = batch.scenario, batch.arrays.tracker, batch.worlds
    slots = np.array(slot_offsets(scenario))
    memory, observations = begin(policy, batch), batch.reset()
    seen: dict[str, list[float]] = {}
    darting, darts = np.zeros(s.worlds, np.bool_), 0
    for step in range(scenario.horizon - 1):
        actions, memory = policy.act(observations, memory)
        observations = batch.step(actions)[0]
        now = worlds["pressed"] < 0
        darts += int((now & ~darting).sum())
        darting = now.copy()
        if step * scenario.control_step < s.after:
            continue
        inside = trackers["slot"] >= 0
        dx, dy = trackers["x"] - worlds["x"][:, None], trackers["y"] - worlds["y"][:, None]
        ahead = dx * worlds["frame_cos"][:, None] + dy * worlds["frame_sin"][:, None]
        behind = slots[trackers["slot"], 0] - ahead
        for key, value in {
            "score": worlds["score"].mean(),
            "trackers' speed, m/s": trackers["speed"].mean(),
            "trackers' |turn rate|, rad/s": np.abs(trackers["turn_rate"]).mean(),
            "distance from the own slot while in it, m": trackers["slot_distance"][inside].mean(),
            "of it behind the slot, m": behind[inside].mean(),
            "target's |turn rate|, rad/s": np.abs(worlds["turn_rate"]).mean(),
        }.items():
            seen.setdefault(key, []).append(float(value))
    return {
        **{key: float(np.mean(values)) for key, values in seen.items()},
        "darts per episode": darts / s.worlds,
    }


def main() -> None:
    """Run, and print a column for each policy."""
    settings = tyro.cli(Settings)
    columns = {name: look(name, settings) for name in settings.policies}
    table = Table(
        title=f"{settings.scenario}, after {settings.after:g} s; {settings.worlds} worlds"
    )
    table.add_column("mean of")
    for name in columns:
        table.add_column(name, justify="right")
    for key in next(iter(columns.values())):
        table.add_row(key, *(f"{figures[key]:.2f}" for figures in columns.values()))
    Console().print(table)


if __name__ == "__main__":
    main()
