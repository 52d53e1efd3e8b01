"""Which limits make a duel: what a target learns under several turn rates and speeds.

    python benchmarks/duel.py --steps 1000000 --out runs/duel

trains a target against a scripted team under each of the limits below, and writes what it costs
that team, beside the scripted smart target from the same starts, and how it moves: where a target
loops on the spot, its net way in 20 s is a small share of its path. A run that was interrupted is
resumed by the same command. Results: docs/duel.md.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import tyro
from rich.console import Console

import posse
from posse import Scenario, get_scenario
from posse.numeric import FloatArray
from posse_baselines import Target, against, load, load_target, rollout
from posse_training.reports.evaluation import evaluate
from posse_training.runs.defaults import default_settings
from posse_training.runs.saved.folder import BEST, LAST, SETTINGS
from posse_training.runs.settings import TrainSettings
from posse_training.runs.train import resume, train

LIMITS: Final[dict[str, dict[str, float]]] = {
    "smart": {"tracker_turn_rate": 1.2, "target_turn_rate": 2.0},
    "equal": {"tracker_turn_rate": 1.5, "target_turn_rate": 1.5},
    "moving": {"tracker_turn_rate": 1.5, "target_turn_rate": 1.5, "target_least_speed": 0.45},
    "full-speed": {"tracker_turn_rate": 1.5, "target_turn_rate": 1.5, "target_least_speed": 0.6},
}
"""What each candidate changes in the scenario ``smart``; rad/s and m/s."""
WORLDS: Final = 200
_PATH_WORLDS: Final = 64
_WINDOW: Final = 20.0  # s


@dataclass(frozen=True)
class Settings:
    """Train a target under several limits."""

    limits: tuple[str, ...] = tuple(LIMITS)
    """Which of the limits."""
    team: str = "ddcs-tuned"
    """The team that chases it."""
    steps: int = 1_000_000
    """Steps of each training."""
    seed: int = 1
    """Seed of each training."""
    out: Path = Path("runs/duel")
    """Folder of the trainings and of results.json."""


def trained(scenario: dict[str, Any], s: Settings, folder: Path) -> Target:
    """Return the target that was trained under limits; train it, or go on with that, if needed."""
    if not (folder / LAST).is_file():
        if (folder / SETTINGS).is_file():
            resume(folder)
        else:
            values = default_settings("smart", side="target").to_dict()
            changed = {
                "steps": s.steps,
                "seed": s.seed,
                "overrides": scenario,
                "against": s.team,
                "folder": str(folder),
                "evaluate_every": max(1, s.steps // 4),
                "tensorboard": False,
            }
            train(TrainSettings.from_dict({**values, **changed}))
    return load_target(folder / BEST)


def paths(team: str, scenario: Scenario, target: Target) -> FloatArray:
    """Return where the target was at each control step, (steps, worlds, 2), m."""
    policy = load(team)
    fitted = target.fit(scenario).replace(message_size=policy.message_size)
    batch = posse.Batch(fitted, _PATH_WORLDS, seed=11, split="test", autoreset="disabled")
    steps = zip(range(scenario.horizon), rollout(batch, against(policy, target)), strict=False)
    places = [np.stack([batch.worlds["x"], batch.worlds["y"]], axis=1) for _ in steps]
    return np.array(places, np.float32)


def motion(places: FloatArray, scenario: Scenario) -> dict[str, float]:
    """Return mean speed, m/s, and the share of the path that is net way in 20 s."""
    window = round(_WINDOW / scenario.control_step)
    ways = np.linalg.norm(np.diff(places, axis=0), axis=2)
    path = np.cumsum(ways, axis=0)
    net = np.linalg.norm(places[window:-1] - places[: -window - 1], axis=2)
    walked = path[window:] - path[:-window]
    return {
        "speed": float(ways.mean() / scenario.control_step),
        "net_share": float(net.mean() / max(float(walked.mean()), 1e-9)),
        "net_in_20_s": float(net.mean()),
    }


def main() -> None:
    """Train, evaluate, and print a table."""
    s = tyro.cli(Settings)
    rows = []
    for name in s.limits:
        scenario = get_scenario("smart", **LIMITS[name])
        target = trained(LIMITS[name], s, s.out / name)
        row: dict[str, Any] = {"limits": name, **LIMITS[name]}
        for label, chased in (("smart", load_target("smart")), ("learned", target)):
            played = evaluate(s.team, scenario, WORLDS, target=chased, progress=False)
            estimate = played.estimate("score")
            row[label] = [estimate.value, estimate.low, estimate.high]
            row[f"{label}_safe"] = float(played["safe_score"].mean())
            row[f"{label}_contacts"] = float((played["target_contacts"] > 0).mean())
            row[f"{label}_motion"] = motion(paths(s.team, scenario, chased), scenario)
        rows.append(row)
        Console().print(row)
    s.out.mkdir(parents=True, exist_ok=True)
    text = json.dumps({"team": s.team, "steps": s.steps, "seed": s.seed, "rows": rows}, indent=2)
    (s.out / "results.json").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
