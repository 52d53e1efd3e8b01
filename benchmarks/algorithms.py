"""``make algorithms``: what algorithms reach from nothing, with the same budget and inputs.

Writes a row of benchmarks/algorithms.csv for each run. Runs with a row are skipped and interrupted ones resume.

    python benchmarks/algorithms.py --algorithm ppo sac --scenario smart --seed 1
"""

from __future__ import annotations

import csv
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import tyro
from rich.console import Console

from posse_baselines import load
from posse_training.evaluation.evaluation import evaluate
from posse_training.evaluation.statistics import mean
from posse_training.provenance import commit
from posse_training.train.presets import default_settings
from posse_training.train.settings import LAST, TrainSettings
from posse_training.train.train import train

TABLE: Final = Path(__file__).parent / "algorithms.csv"
COLUMNS: Final = (
    *("algorithm", "scenario", "version", "training_seed", "steps", "worlds", "seed"),
    *("safe_score", "low", "high", "score", "contact_free", "area", "steps_per_second", "commit"),
)
CHANGES: Final[dict[str, dict[str, Any]]] = {
    "ppo": {},
    "mappo": {"algorithm": "mappo"},
    "sac": {"algorithm": "sac"},
    "td3": {"algorithm": "td3"},
    "ppo-imitation": {"imitate": "ddcs-tuned", "safeguard": False},
}
"""Settings of each algorithm beyond the defaults of its class."""
OFF_POLICY: Final = ("sac", "td3")
TEST_SEED: Final = 7


@dataclass(frozen=True)
class Settings:
    """Command-line arguments."""

    algorithm: tuple[str, ...] = tuple(CHANGES)
    scenario: tuple[str, ...] = ("smart", "radio", "field")
    seed: tuple[int, ...] = (1, 2, 3)
    steps: int = 10_000_000
    """Steps of training; a step is one control step of one tracker."""
    off_policy_steps: int = 1_000_000
    """The same for sac and td3, whose steps take longer."""
    worlds: int = 500
    """Worlds of the split ``test`` that the last policy plays."""
    out: Path = Path("runs/algorithms")


def settings_of(s: Settings, algorithm: str, scenario: str, seed: int) -> TrainSettings:
    """Return the settings of one run."""
    changes = dict(CHANGES[algorithm])
    base = default_settings(scenario, changes.pop("algorithm", "ppo"), preset="nothing")
    steps = s.off_policy_steps if algorithm in OFF_POLICY else s.steps
    folder = s.out / f"{algorithm}-{scenario}-{seed}"
    run: dict[str, Any] = {"seed": seed, "steps": steps, "evaluate_every": steps // 20, "folder": folder}
    return replace(base, **changes, **run, tensorboard=False, beside=None)


def row_of(run: TrainSettings, algorithm: str, worlds: int) -> dict[str, Any]:
    """Return the row of a finished run: its last policy on test worlds, and the area under its curve."""
    policy = load(str(run.run_folder / LAST))
    card: dict[str, Any] = policy.card  # type: ignore[attr-defined]
    results = evaluate(policy, run.scenario, worlds, TEST_SEED, split="test", progress=False)
    safe, last = mean(results["safe_score"]), card["curve"][-1]
    steps = [0.0, *(point["steps"] for point in card["curve"])]
    scores = [0.0, *(point["safe_score"] for point in card["curve"])]
    area = float(np.trapezoid(scores, steps) / steps[-1])
    numbers = (safe.value, safe.low, safe.high, results["score"].mean(), results["contact_free"].mean(), area)
    values = (
        *(algorithm, run.scenario, results.scenario.version, run.seed, card["steps"], worlds, TEST_SEED),
        *(f"{number:.6f}" for number in numbers),
        *(round(last["steps"] / last["seconds"]), commit()),
    )
    return dict(zip(COLUMNS, values, strict=True))


def main() -> None:
    """Train what has no row yet."""
    s = tyro.cli(Settings, description=__doc__)
    with TABLE.open(newline="", encoding="utf-8") as file:
        done = {(row["algorithm"], row["scenario"], int(row["training_seed"])) for row in csv.DictReader(file)}
    console = Console()
    todo = [(a, c, n) for n in s.seed for c in s.scenario for a in s.algorithm if (a, c, n) not in done]
    for algorithm, scenario, seed in todo:
        run = settings_of(s, algorithm, scenario, seed)
        train(run, console=console)
        with TABLE.open("a", newline="", encoding="utf-8") as file:
            csv.DictWriter(file, COLUMNS, lineterminator="\n").writerow(row_of(run, algorithm, s.worlds))


if __name__ == "__main__":
    main()
