"""``posse reproduce``: section 4 of the paper, its figures 7 to 10, and results that it announces.

The paper does not state scale, gains and starts; docs/paper.md lists those chosen here.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
import tyro
from rich.console import Console

import posse
from posse_baselines.ddcs.baseline import FAMILY
from posse_baselines.files import write_atomically
from posse_training.reproduce import runs
from posse_training.reproduce.figures import Shown, curves, frames, leader_loss, tracks
from posse_training.reproduce.runs import SPEED_TOLERANCE, SPLIT, TOLERANCE, Floats
from posse_training.style import RC, save

HORIZON: Final = 250
"""Control steps of an episode, enough for the slowest law to settle."""
PLAYED: Final = "paper-distributed"
"""Scenario of all runs; that of the centralized model differs only in name."""


@dataclass(frozen=True)
class Model:
    """One model of the paper: its policies here, and the paper's figures."""

    name: str
    paper_policy: str
    our_policy: str
    paper_settling_time: float


MODELS: Final = (
    Model("centralized", "pngl-l-phi", "ddcs-centralized", 1.6),
    Model("distributed", "pngl", "ddcs-distributed", 2.0),
)
MEMBERS: Final = tuple(name for name in FAMILY if name != "ddcs-no-radio")
"""Policies whose settling times are measured."""


@dataclass(frozen=True)
class Settings:
    """Arguments of ``posse reproduce``."""

    out: Path = Path("runs/paper")
    """Folder for figures (PNG and SVG) and numbers (JSON)."""
    starts: int = 200
    """Number of drawn starts; figures show the run with the median settling time."""
    seed: int = 7
    """Seed of the starts, in the test split."""


def summary(policy: str, times: Floats, error: Floats) -> dict[str, Any]:
    """Return the numbers of a policy: times (E,) s, and final distances from slots (E, N) m."""
    known = times[np.isfinite(times)]
    model = next((m for m in MODELS if policy == m.paper_policy), None)
    return {
        "policy": policy,
        "model": "centralized" if FAMILY[policy].model == "centralized" else "distributed",
        "paper_settling_time": model.paper_settling_time if model else None,
        "settling_time_quartiles": (np.percentile(known, [25, 50, 75]).tolist() if len(known) else [None] * 3),
        "settled": len(known),
        "in_slots": int((error < 0.2).all(axis=1).sum()),
        "starts": len(times),
    }


def reproduce(settings: Settings) -> list[dict[str, Any]]:
    """Play every member of the family, write figures and numbers, and return the numbers."""
    scenario = posse.get_scenario(PLAYED, horizon=HORIZON)
    tracker_pose, target_pose = runs.draw_starts(scenario, settings.starts, settings.seed)
    settings.out.mkdir(parents=True, exist_ok=True)
    starts = {"tracker_pose": tracker_pose, "target_pose": target_pose}
    rows, played = [], {}
    for policy in MEMBERS:
        run = runs.run_of(policy, scenario, settings.starts, settings.seed, starts)
        played[policy] = run, runs.settling_times(run)
        rows.append(summary(policy, played[policy][1], runs.slot_error(run)[-1]))
    with mpl.rc_context(RC):
        for model in MODELS:
            world = runs.median_world(played[model.paper_policy][1])
            pair = [
                Shown(policy, played[policy][0], world, float(played[policy][1][world]))
                for policy in (model.paper_policy, model.our_policy)
            ]
            facts = f"start {world}, the median of {settings.starts:,} starts, {runs.played(scenario, settings.seed)}"
            save(frames(pair, facts), settings.out, f"{model.name}-frames")
            save(curves(pair, model.paper_settling_time, facts), settings.out, f"{model.name}-curves")
        save(tracks(settings.seed), settings.out, "tracks")
        loss = leader_loss("pngl-l-phi", settings.starts, settings.seed)
        save(loss, settings.out, "leader-loss")
    stated = {"seed": settings.seed, "split": SPLIT, "tolerance": TOLERANCE}
    text = json.dumps({**stated, "policies": rows}, indent=2)
    write_atomically(settings.out / "settling.json", f"{text}\n".encode())
    return rows


def table(rows: Sequence[dict[str, Any]], settings: Settings) -> str:
    """Return the settling times with those of the paper."""
    game = runs.played(posse.get_scenario(PLAYED), settings.seed)
    line = "{:<28} {:<11} {:>5}  {:<17} {:>7} {:>8}".format
    lines = [
        f"settling time, s: finally within {TOLERANCE:g} m and {SPEED_TOLERANCE:g} m/s;",
        f"{settings.starts:,} starts of {game}",
        line("policy", "model", "paper", "median, quartiles", "settled", "in slots"),
    ]
    for row in rows:
        low, middle, high = row["settling_time_quartiles"]
        paper = "-" if row["paper_settling_time"] is None else f"{row['paper_settling_time']:.1f}"
        median = "-" if middle is None else f"{middle:.1f} [{low:.1f}, {high:.1f}]"
        lines.append(line(row["policy"], row["model"], paper, median, row["settled"], row["in_slots"]))
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> None:
    """Reproduce the paper's experiments and print the settling times with those of the paper."""
    settings = tyro.cli(
        Settings,
        prog="posse reproduce",
        description="Repeat the experiments of the paper's section 4: figures and settling times.",
        args=arguments,
    )
    rows = reproduce(settings)
    Console().print(f"{table(rows, settings)}\nfigures and numbers: {settings.out}", markup=False, soft_wrap=True)
