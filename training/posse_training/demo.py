"""``make demo``: a table of scores and a moving picture for each of the three target motions."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Final

from rich.console import Console
from rich.table import Table

from posse_baselines import load
from posse_training.evaluation import Results, evaluate, progress_bar
from posse_training.film import film
from posse_training.statistics import Estimate, mean, share

SCENARIOS: Final = ("constant", "accelerating", "smart")
POLICIES: Final = ("random", "idle", "pursuit", "ddcs-centralized", "ddcs-distributed")
EPISODES: Final = 500
SEED: Final = 7
FOLDER: Final = Path("runs/demo")


def main() -> None:
    """Play every policy in every scenario, print the table, and film the best."""
    console = Console()
    started = time.perf_counter()
    results: dict[tuple[str, str], Results] = {}
    with progress_bar() as bar:
        total = len(SCENARIOS) * len(POLICIES)
        task = bar.add_task("compiling, then playing", total=total)
        for scenario in SCENARIOS:
            for name in POLICIES:
                bar.update(task, description=f"{name} on {scenario}")
                results[scenario, name] = evaluate(name, scenario, EPISODES, SEED, progress=False)
                bar.advance(task)
    console.print(table(results))
    for scenario in SCENARIOS:
        best = max(POLICIES, key=lambda name: results[scenario, name]["score"].mean())
        path = FOLDER / f"{scenario}.gif"
        with console.status(f"filming {best} on {scenario}"):
            film([(best, load(best))], scenario, seed=SEED, world=0, path=path, split="test")
        console.print(f"{best} on {scenario}: {path}")
    console.print(f"{time.perf_counter() - started:.0f} s in all")


def table(results: dict[tuple[str, str], Results]) -> Table:
    """Return the table of scores, with 95 % intervals."""
    episodes = next(iter(results.values())).episodes
    shown = Table(title=f"{episodes} worlds each, split test, seed {SEED}; 95 % intervals")
    for column in ("target", "policy", "score", "tracking error, m", "settled", "settling time, s"):
        shown.add_column(column)
    shown.add_column("worlds with a contact")
    last = ""
    for (scenario, name), result in results.items():
        shown.add_row(
            scenario if scenario != last else "",
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
            end_section=name == POLICIES[-1],
        )
        last = scenario
    return shown


def _cell(estimate: Estimate) -> str:
    if estimate.count == 0:
        return "never"
    return f"{estimate.value:.2f} [{estimate.low:.2f}, {estimate.high:.2f}]"


if __name__ == "__main__":
    main()
