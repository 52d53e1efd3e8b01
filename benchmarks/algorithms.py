"""What the field's algorithms reach: each trained from nothing, with the same budget and inputs.

Finished runs are skipped and interrupted ones resume, so that it can be stopped at any time; each
result is kept in benchmarks/algorithms. Writes the table and the figure of docs/algorithms.md.

    make algorithms
    python benchmarks/algorithms.py --algorithms ppo sac --scenarios smart --seeds 1
"""

from __future__ import annotations

import json
import subprocess
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import tyro
from algorithms_page import RESULTS, write_page
from rich.console import Console

from posse_baselines import load
from posse_training.provenance import commit
from posse_training.reports.evaluation import evaluate
from posse_training.reports.statistics import mean
from posse_training.runs.defaults import default_settings
from posse_training.runs.saved.curve import POINT
from posse_training.runs.saved.folder import LAST, SETTINGS
from posse_training.runs.settings import TrainSettings
from posse_training.runs.train import resume, train

OFF_POLICY: Final = ("sac", "td3")
BENCHMARL: Final = ("qmix",)
"""Learned by BenchMARL in an environment of its own, off policy as well."""
BENCHMARL_PYTHON: Final = Path(".venv-recipes/bin/python")
CHANGES: Final[dict[str, dict[str, Any]]] = {
    "ppo": {},
    "mappo": {"algorithm": "mappo"},
    "sac": {"algorithm": "sac"},
    "td3": {"algorithm": "td3"},
    "ppo-imitation": {"imitate": "ddcs-tuned"},
}
"""Settings of each algorithm beyond the defaults of its class."""
TEST_SEED: Final = 7


@dataclass(frozen=True)
class Settings:
    """Command-line arguments."""

    algorithms: tuple[str, ...] = (*CHANGES, *BENCHMARL)
    scenarios: tuple[str, ...] = ("smart", "radio", "field")
    seeds: tuple[int, ...] = (1, 2, 3)
    steps: int = 10_000_000
    """Steps of training; a step is one control step of one tracker."""
    off_policy_steps: int = 1_000_000
    """The same for sac, td3 and qmix, whose steps take longer."""
    worlds: int = 500
    """Worlds of the split ``test`` that the last policy plays."""
    folder: Path = Path("runs/algorithms")
    page_only: bool = False
    """Write the page from the results that there are."""


def settings_of(s: Settings, algorithm: str, scenario: str, seed: int) -> TrainSettings:
    """Return the settings of one run."""
    changes = dict(CHANGES[algorithm])
    base = default_settings(scenario, changes.pop("algorithm", "ppo"), own=False)
    steps = s.off_policy_steps if algorithm in OFF_POLICY else s.steps
    return replace(
        base,
        **changes,
        seed=seed,
        steps=steps,
        evaluate_every=steps // 20,
        tensorboard=False,
        beside=None,
        folder=s.folder / f"{algorithm}-{scenario}-{seed}",
    )


def result_of(run: TrainSettings, algorithm: str, worlds: int) -> dict[str, Any]:
    """Return what is kept of a finished run: its curve, and its last policy on test worlds."""
    policy = load(str(run.run_folder / LAST))
    card: dict[str, Any] = policy.card  # type: ignore[attr-defined]
    results = evaluate(policy, run.scenario, worlds, TEST_SEED, split="test", progress=False)
    return {
        "algorithm": algorithm,
        "scenario": run.scenario,
        "version": results.scenario.version,
        "seed": run.seed,
        "steps": card["steps"],
        "commit": commit(),
        "curve": [{name: point[name] for name in POINT} for point in card["curve"]],
        "test": {
            "seed": TEST_SEED,
            "worlds": worlds,
            "safe_score": mean(results["safe_score"]).to_dict(),
            "score": float(results["score"].mean()),
            "contact_free": float(results["contact_free"].mean()),
        },
    }


def train_here(s: Settings, algorithm: str, scenario: str, seed: int, console: Console) -> str:
    """Train with the package's own trainer, or go on with that; return the result as JSON."""
    run = settings_of(s, algorithm, scenario, seed)
    if (run.run_folder / SETTINGS).is_file():
        resume(run.run_folder, console=console)
    else:
        train(run, console=console)
    return json.dumps(result_of(run, algorithm, s.worlds), indent=1) + "\n"


def train_in_benchmarl(s: Settings, algorithm: str, scenario: str, seed: int) -> str:
    """Train with BenchMARL, from the start; return the result as JSON."""
    out = s.folder / f"{algorithm}-{scenario}-{seed}" / "result.json"
    out.parent.mkdir(parents=True, exist_ok=True)
    subprocess.run(
        [
            str(BENCHMARL_PYTHON),
            str(Path(__file__).with_name("algorithms_benchmarl.py")),
            algorithm,
            scenario,
            "--seed",
            str(seed),
            "--steps",
            str(s.off_policy_steps),
            "--worlds",
            str(s.worlds),
            "--out",
            str(out),
        ],
        check=True,
    )
    return out.read_text(encoding="utf-8")


def main() -> None:
    """Train what is left, and write the page."""
    s = tyro.cli(Settings, description=__doc__)
    console = Console()
    RESULTS.mkdir(exist_ok=True)
    for seed in s.seeds:
        for scenario in s.scenarios:
            for algorithm in s.algorithms if not s.page_only else ():
                kept = RESULTS / f"{algorithm}-{scenario}-{seed}.json"
                if kept.is_file():
                    continue
                console.print(kept.stem, style="bold")
                if algorithm not in BENCHMARL:
                    text = train_here(s, algorithm, scenario, seed, console)
                elif BENCHMARL_PYTHON.is_file():
                    text = train_in_benchmarl(s, algorithm, scenario, seed)
                else:
                    console.print(f"left out: no {BENCHMARL_PYTHON} (make recipes)")
                    continue
                kept.write_text(text, encoding="utf-8")
    write_page(console)


if __name__ == "__main__":
    main()
