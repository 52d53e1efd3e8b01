"""``posse demo``: a table of scores, a film of the best team for each target motion, and a replay page."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import tyro
from rich import box
from rich.console import Console
from rich.table import Table

from posse_baselines import load, policy_names
from posse_training.errors import SettingsError
from posse_training.evaluation import Estimate, Results, evaluate
from posse_training.evaluation.evaluation import progress_bar
from posse_training.evaluation.statistics import mean, share
from posse_training.film import film
from posse_training.replay import record, write_replay

SCENARIOS: Final = ("constant", "accelerating", "smart")
POLICIES: Final = ("random", "idle", "pursuit", "ddcs-centralized", "ddcs-distributed", "ddcs-tuned")
LEARNED: Final = "learned-smart"
"""Plays the scenario that it was trained on, if it is shipped."""
SEED: Final = 7
FOLDER: Final = Path("runs/demo")


def main(arguments: Sequence[str]) -> None:
    """Run the demo."""
    tyro.cli(demo, prog="posse demo", args=arguments)


def demo(episodes: int = 500, seconds: float = 25.0) -> None:
    """Play every scripted team in three scenarios; print a table, write films and a replay page.

    Args:
        episodes: Worlds for each policy and scenario.
        seconds: Simulated time of a film, s.
    """
    if episodes < 2:
        raise SettingsError(f"episodes={episodes} is too few for an interval: 2 or more")
    if not 0 < seconds <= 3600:
        raise SettingsError(f"seconds={seconds} is not a length of a film: 0 to 3,600")
    console, started = Console(), time.perf_counter()
    plays = [(scenario, policy) for scenario in SCENARIOS for policy in POLICIES]
    if LEARNED in policy_names():
        plays.append(("smart", LEARNED))
    policies = {name: load(name) for _, name in plays}
    results: dict[tuple[str, str], Results] = {}
    written: dict[str, Path] = {}
    with progress_bar() as bar:
        task = bar.add_task("compiling, then playing", total=len(plays))
        for scenario, name in plays:
            bar.update(task, description=f"{name} on {scenario}")
            results[scenario, name] = evaluate(policies[name], scenario, episodes, SEED, progress=False)
            bar.advance(task)
        for scenario in SCENARIOS:
            names = shown(scenario, results)
            bar.update(task, description=f"filming {scenario}")
            teams, path = [(name, policies[name]) for name in names], FOLDER / f"{scenario}.gif"
            written[f"{' beside '.join(names)} on {scenario}"] = film(
                teams, scenario, seed=SEED, path=path, seconds=seconds
            )
        bar.update(task, description="writing the replay page")
        replay = record([policies[name] for name in names], scenario, seed=SEED)
        written[f"{' beside '.join(names)} on {scenario}, to open in a browser"] = write_replay(
            replay, FOLDER / "replay.html"
        )
    console.print(table(results))
    for title, path in written.items():
        console.print(f"{title}: {path}", markup=False, soft_wrap=True)
    console.print(f"total time: {time.perf_counter() - started:.0f} s")


def shown(scenario: str, results: Mapping[tuple[str, str], Results]) -> list[str]:
    """Return the policies to film: the best scripted one, and the learned one if it played."""
    best = max(POLICIES, key=lambda name: results[scenario, name]["safe_score"].mean())
    return [best, LEARNED] if (scenario, LEARNED) in results else [best]


def table(results: Mapping[tuple[str, str], Results]) -> Table:
    """Return the table of scores, with 95 % intervals."""
    episodes = next(iter(results.values())).episodes
    made = Table(
        title=f"{episodes} worlds each, split test, seed {SEED}; 95 % intervals",
        box=box.HORIZONTALS,  # no vertical bars: the figures need all of 80 characters
        collapse_padding=True,
        pad_edge=False,
    )
    made.add_column("target", no_wrap=True)
    made.add_column("policy", no_wrap=True)
    for column in ("safe score", "tracking error, m", "settled", "settling time, s", "worlds with a contact"):
        made.add_column(column)
    before = ""
    for (scenario, name), result in results.items():
        if before not in ("", scenario):
            made.add_section()
        estimates = (
            mean(result["safe_score"]),
            mean(result["tracking_error"]),
            share(result.settled),
            mean(result["settling_time"]),
            share(result.contacts > 0),
        )
        made.add_row("" if scenario == before else scenario, name, *map(_cell, estimates))
        before = scenario
    return made


def _cell(estimate: Estimate) -> str:
    if estimate.count == 0:
        return "never"
    return f"{estimate.value:.2f}\n[{estimate.low:.2f}, {estimate.high:.2f}]"
