"""Part of ``make results``: result files of the leaderboard, for policies of the package.

Writes benchmarks/leaderboard/SCENARIO-POLICY.json, which pages of the manual read when it is built.
benchmarks/results.py writes those of the scripted teams; this one by default the learned teams'.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import tyro

import posse
from posse_baselines import Policy, load, policy_names
from posse_baselines.registry import LEARNED
from posse_training.leaderboard import write_result
from posse_training.leaderboard.submit import SEED, WORLDS, result_of
from posse_training.reports.evaluation import Results, evaluate
from posse_training.reports.statistics import mean

FOLDER = Path(__file__).parent / "leaderboard"
SCENARIOS = tuple(name for name in posse.scenario_names() if not name.startswith("paper"))


@dataclass(frozen=True)
class Settings:
    """Command-line arguments."""

    policies: tuple[str, ...] = tuple(n for n in policy_names() if n.startswith(LEARNED))
    scenarios: tuple[str, ...] = SCENARIOS
    worlds: int = WORLDS


def keep(name: str, policy: Policy, results: Results) -> Path:
    """Write the result file of an evaluation of a policy of the package."""
    path = FOLDER / f"{results.scenario.name}-{name}.json"
    return write_result(result_of(name, policy, results), path)


def main() -> None:
    """Play everything."""
    settings = tyro.cli(Settings)
    for scenario in settings.scenarios:
        for name in settings.policies:
            policy = load(name)
            results = evaluate(policy, scenario, settings.worlds, SEED, progress=False)
            keep(name, policy, results)
            print(f"{scenario:12s} {name:30s} {mean(results['safe_score'])}", flush=True)


if __name__ == "__main__":
    main()
