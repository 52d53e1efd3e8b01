"""``make demo``: a table of scores, a film of each target motion, and scripted against learned."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.table import Table

from posse_baselines import load, policy_names
from posse_training.evaluation import Results, evaluate, progress_bar
from posse_training.film import film
from posse_training.statistics import Estimate, mean, share

SCENARIOS: Final = ("constant", "accelerating", "smart")
POLICIES: Final = ("random", "idle", "pursuit", "ddcs-centralized", "ddcs-distributed")
LEARNED: Final = "learned-smart"
"""Plays on the target that it was trained on, if it is shipped."""
EPISODES: Final = 500
SEED: Final = 7
FOLDER: Final = Path("runs/demo")


def main(episodes: int = EPISODES, seconds: float = 25.0) -> None:
    """Play every policy in every scenario, print the table, and film the best.

    Args:
        episodes: Worlds for each policy and scenario.
        seconds: Simulated time of a film, s.
    """
    console = Console()
    started = time.perf_counter()
    plays = [(scenario, policy) for scenario in SCENARIOS for policy in POLICIES]
    if LEARNED in policy_names():
        plays.append(("smart", LEARNED))
    results: dict[tuple[str, str], Results] = {}
    with progress_bar() as bar:
        task = bar.add_task("compiling, then playing", total=len(plays))
        for scenario, name in plays:
            bar.update(task, description=f"{name} on {scenario}")
            results[scenario, name] = evaluate(name, scenario, episodes, SEED, progress=False)
            bar.advance(task)
    console.print(table(results))

    def show(scenario: str, names: Sequence[str], file: str) -> None:
        path = FOLDER / file
        with console.status(f"filming {' and '.join(names)} on {scenario}"):
            film(
                [(name, load(name)) for name in names],
                scenario, seed=SEED, world=0, path=path, split="test", seconds=seconds,
            )  # fmt: skip
        console.print(f"{' beside '.join(names)} on {scenario}: {path}")

    best = {
        scenario: max(POLICIES, key=lambda name: results[scenario, name]["score"].mean())
        for scenario in SCENARIOS
    }
    for scenario, name in best.items():
        beside = [LEARNED] if (scenario, LEARNED) in results else []
        show(scenario, [name, *beside], f"{scenario}.gif")
    console.print(f"{time.perf_counter() - started:.0f} s in all")


def table(results: dict[tuple[str, str], Results]) -> Table:
    """Return the table of scores, with 95 % intervals."""
    episodes = next(iter(results.values())).episodes
    shown = Table(title=f"{episodes} worlds each, split test, seed {SEED}; 95 % intervals")
    shown.add_column("target", no_wrap=True)
    shown.add_column("policy", no_wrap=True)
    for column in ("score", "tracking error, m", "settled", "settling time, s"):
        shown.add_column(column)
    shown.add_column("worlds with a contact")
    keys = list(results)
    for k, ((scenario, name), result) in enumerate(results.items()):
        follows = k > 0 and keys[k - 1][0] == scenario
        ends = k + 1 == len(keys) or keys[k + 1][0] != scenario
        shown.add_row(
            "" if follows else scenario,
            name,
            *(
                _cell(estimate)
                for estimate in (
                    mean(result["score"]),
                    mean(result["tracking_error"]),
                    share(result.settled),
                    mean(result["settling_time"]),
                    share(result.contacts > 0),
                )
            ),
            end_section=ends,
        )
    return shown


def _cell(estimate: Estimate) -> str:
    if estimate.count == 0:
        return "never"
    return f"{estimate.value:.2f} [{estimate.low:.2f}, {estimate.high:.2f}]"


if __name__ == "__main__":
    main()
