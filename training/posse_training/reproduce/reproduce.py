"""``posse reproduce``: section 4 of the paper, its figures 7 to 10, and results that it announces.

The paper does not state scale, gains and starts; docs/paper.md lists those chosen here.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np
import tyro
from rich.console import Console

import posse
from posse_baselines import Trajectory
from posse_baselines.ddcs.baseline import FAMILY
from posse_baselines.files import write_json
from posse_training.errors import SettingsError
from posse_training.reproduce import runs
from posse_training.reproduce.figures import curves, frames, leader_loss, tracks
from posse_training.reproduce.runs import SPEED_TOLERANCE, SPLIT, TOLERANCE
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
_IN_SLOT: Final = 0.2  # m; a tracker this near to a slot at the end occupies it


def summary(policy: str, run: Trajectory) -> dict[str, Any]:
    """Return the numbers of a policy."""
    times, in_slots = runs.settling_times(run), runs.slot_error(run)[-1] < _IN_SLOT
    known = times[np.isfinite(times)]
    return {
        "policy": policy,
        "model": FAMILY[policy].model,
        "paper_settling_time": {m.paper_policy: m.paper_settling_time for m in MODELS}.get(policy),
        "settling_time_quartiles": np.percentile(known, [25, 50, 75]).tolist() if len(known) else [None] * 3,
        "settled": len(known),
        "in_slots": int(in_slots.all(axis=1).sum()),
        "starts": len(times),
    }


def reproduce(out: Path = Path("runs/paper"), starts: int = 200, seed: int = 7) -> list[dict[str, Any]]:
    """Repeat the experiments of the paper's section 4: figures and settling times.

    Args:
        out: Folder for figures (PNG and SVG) and numbers (JSON), which replace old ones.
        starts: Number of drawn starts; figures show the run with the median settling time.
        seed: Seed of the starts, in the test split.
    """
    if starts < 1:
        raise SettingsError(f"starts={starts} must be at least 1")
    scenario = posse.get_scenario(PLAYED, horizon=HORIZON)
    poses = runs.draw_starts(scenario, starts, seed)
    out.mkdir(parents=True, exist_ok=True)
    played = {policy: runs.run_of(policy, scenario, starts, seed, poses) for policy in MEMBERS}
    rows = [summary(policy, run) for policy, run in played.items()]
    game = runs.played(scenario, seed)
    with mpl.rc_context(RC):
        for model in MODELS:
            world = runs.median_world(runs.settling_times(played[model.paper_policy]))
            pair = {policy: played[policy].episode(world) for policy in (model.paper_policy, model.our_policy)}
            facts = f"start {world}, the median of {starts:,} starts, {game}"
            save(frames(pair, facts), out, f"{model.name}-frames")
            save(curves(pair, model.paper_settling_time, facts), out, f"{model.name}-curves")
        save(tracks(seed), out, "tracks")
        save(leader_loss("pngl-l-phi", starts, seed), out, "leader-loss")
    stated = {"seed": seed, "split": SPLIT, "tolerance": TOLERANCE}
    write_json(out / "settling.json", {**stated, "policies": rows})
    lines = [
        f"settling time, s: finally within {TOLERANCE:g} m and {SPEED_TOLERANCE:g} m/s;",
        f"{starts:,} starts of {game}",
        *table(rows),
        f"figures and numbers: {out}",
    ]
    Console().print("\n".join(lines), markup=False, soft_wrap=True)
    return rows


def table(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Return lines with the settling times, and those of the paper."""
    line = "{:<28} {:<11} {:>5}  {:<17} {:>7} {:>8}".format
    lines = [line("policy", "model", "paper", "median, quartiles", "settled", "in slots")]
    for row in rows:
        low, middle, high = row["settling_time_quartiles"]
        paper = "-" if row["paper_settling_time"] is None else f"{row['paper_settling_time']:.1f}"
        median = "-" if middle is None else f"{middle:.1f} [{low:.1f}, {high:.1f}]"
        lines.append(line(row["policy"], row["model"], paper, median, row["settled"], row["in_slots"]))
    return lines


def main(arguments: Sequence[str] | None = None) -> None:
    """Reproduce the paper's experiments and print the settling times with those of the paper."""
    tyro.cli(reproduce, prog="posse reproduce", args=arguments)
