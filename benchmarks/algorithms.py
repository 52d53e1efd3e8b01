"""``make algorithms``: what algorithms reach from nothing, with the same budget and inputs.

Writes a row of benchmarks/algorithms.csv for each run. Runs with a row are skipped and interrupted ones resume.

    python benchmarks/algorithms.py --algorithm ppo sac --scenario smart --seed 1
"""

from __future__ import annotations

import csv
import itertools
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

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
    *("algorithm", "safeguard", "scenario", "version", "training_seed", "steps", "worlds", "seed"),
    *("safe_score", "low", "high", "score", "contact_free", "steps_per_second", "commit"),
)
ALGORITHMS: Final = ("ppo", "mappo", "sac", "td3")
NAMES: Final = ("algorithm", "safeguard", "scenario", "training_seed")
OFF_POLICY: Final = ("sac", "td3")
TEST_SEED: Final = 7


@dataclass(frozen=True)
class Settings:
    """Command-line arguments."""

    algorithm: tuple[str, ...] = ALGORITHMS
    safeguard: tuple[bool, ...] = (True, False)
    """Behind the safeguard, and without it."""
    scenario: tuple[str, ...] = ("smart", "radio", "field")
    seed: tuple[int, ...] = (1, 2, 3)
    steps: int = 20_000_000
    """Steps of training; a step is one control step of one tracker."""
    off_policy_steps: int = 1_000_000
    """The same for sac and td3, whose steps take longer."""
    worlds: int = 500
    """Worlds of the split ``test`` that the last policy plays."""
    out: Path = Path("runs/algorithms")


def settings_of(s: Settings, algorithm: str, safeguard: bool, scenario: str, seed: int) -> TrainSettings:
    """Return the settings of one run."""
    steps = s.off_policy_steps if algorithm in OFF_POLICY else s.steps
    folder = s.out / f"{algorithm}-{'safe' if safeguard else 'bare'}-{scenario}-{seed}"
    run: dict[str, Any] = {"seed": seed, "steps": steps, "evaluate_every": steps // 20, "folder": folder}
    run["hidden"] = (128, 128)  # of all algorithms alike
    base = default_settings(scenario, algorithm, preset="nothing")
    return replace(base, **run, safeguard=safeguard, tensorboard=False, beside=None)


def row_of(run: TrainSettings, worlds: int) -> dict[str, Any]:
    """Return the row of a finished run: its last policy on test worlds."""
    policy = load(str(run.run_folder / LAST))
    card: dict[str, Any] = policy.card  # type: ignore[attr-defined]
    results = evaluate(policy, run.scenario, worlds, TEST_SEED, split="test", progress=False)
    safe, last = mean(results["safe_score"]), card["curve"][-1]
    numbers = (safe.value, safe.low, safe.high, results["score"].mean(), results["contact_free"].mean())
    values = (
        *(run.algorithm, run.safeguard, run.scenario, results.scenario.version),
        *(run.seed, card["steps"], worlds, TEST_SEED),
        *(f"{number:.6f}" for number in numbers),
        *(round(last["steps"] / last["seconds"]), commit()),
    )
    return dict(zip(COLUMNS, values, strict=True))


def main() -> None:
    """Train what has no row yet."""
    s = tyro.cli(Settings, description=__doc__)
    with TABLE.open(newline="", encoding="utf-8") as file:
        done = {tuple(row[name] for name in NAMES) for row in csv.DictReader(file)}
    console = Console()
    for seed, scenario, safeguard, algorithm in itertools.product(s.seed, s.scenario, s.safeguard, s.algorithm):
        if (algorithm, str(safeguard), scenario, str(seed)) in done:
            continue
        run = settings_of(s, algorithm, safeguard, scenario, seed)
        train(run, console=console)
        row = row_of(run, s.worlds)
        with TABLE.open("a", newline="", encoding="utf-8") as file:
            csv.DictWriter(file, COLUMNS, lineterminator="\n").writerow(row)


if __name__ == "__main__":
    main()
