"""What pursuit costs the centralized model's leader: the figures of that section in the manual."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

import posse
from posse.scenarios.formation import slot_offsets
from posse_baselines import begin
from posse_baselines.ddcs import DDCS
from posse_baselines.ddcs import Settings as Team


@dataclass(frozen=True)
class Settings:
    """Where to look."""

    scenarios: tuple[str, ...] = ("constant", "accelerating", "smart")
    worlds: int = 200
    seed: int = 3
    split: str = "validation"
    after: float = 20.0
    """Time that the team is given to arrive, s."""


def look(law: str, scenario: str, s: Settings) -> tuple[float, float]:
    """Return the leader's mean distance from the first slot, m, and the mean score."""
    policy = DDCS(Team(model="centralized", leader_law=law))
    batch = posse.batch(
        scenario, s.worlds, seed=s.seed, split=s.split, message_size=policy.message_size
    )
    target, trackers, every = batch.worlds, batch.arrays.tracker, np.arange(s.worlds)
    memory, observations = begin(policy, batch), batch.reset()
    x, y = slot_offsets(batch.scenario)[0]
    errors, scores = [], []
    for step in range(batch.scenario.horizon - 1):
        actions, memory = policy.act(observations, memory)
        observations = batch.step(actions)[0]
        scores.append(target["score"].mean())
        if step * batch.scenario.control_step < s.after:
            continue
        leaders = np.median(policy.annotations(memory)["leader"], axis=1).astype(int)
        leader = trackers[every, np.maximum(leaders, 0)]
        c, sine = target["frame_cos"], target["frame_sin"]
        dx = target["x"] + c * x - sine * y - leader["x"]
        dy = target["y"] + sine * x + c * y - leader["y"]
        errors.append(np.hypot(dx, dy)[leaders >= 0].mean())
    return float(np.mean(errors)), float(np.mean(scores))


def main() -> None:
    """Play, and print a row for each scenario."""
    s = tyro.cli(Settings)
    table = Table(title=f"ddcs-centralized, {s.worlds} worlds, split {s.split}, seed {s.seed}")
    for column in ("scenario", "pursuit: off slot", "score", "slot: off slot", "score"):
        table.add_column(column, justify="right")
    for scenario in s.scenarios:
        cells = []
        for law in ("pursuit", "slot"):
            error, mean = look(law, scenario, s)
            cells += [f"{error:.2f} m", f"{mean:.3f}"]
        table.add_row(scenario, *cells)
    Console().print(table)


if __name__ == "__main__":
    main()
