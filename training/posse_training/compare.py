"""``posse compare``: policies on the same worlds, with intervals and paired differences."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.console import Console
from rich.table import Table

from posse import scenario_names
from posse_baselines import load
from posse_training.evaluation import Results, evaluate
from posse_training.statistics import (
    Estimate,
    interquartile_mean,
    mean,
    paired_difference,
    probability_of_improvement,
    share,
)


@dataclass(frozen=True)
class Settings:
    """What ``posse compare`` takes."""

    policies: Annotated[tuple[str, ...], tyro.conf.Positional]
    """Names, files or package.module:Class; differences are to the first."""
    scenarios: tuple[str, ...] = ("all",)
    """Names of scenarios, or "all"."""
    episodes: int = 1000
    """Worlds for each policy and scenario."""
    seed: int = 7
    """Of the worlds."""
    split: str = "test"
    """Of the worlds: train, validation or test."""
    out: Path = Path("runs/compare")
    """Folder for the rows (CSV) and the summary (JSON)."""


def compare(settings: Settings) -> list[dict[str, Any]]:
    """Play everything, write rows and summary, and return a dictionary for each pair.

    Raises:
        PolicyError: An unknown policy; nothing is played.
        ScenarioError: An unknown scenario.
        ValueError: A split that a policy was trained on.
    """
    policies = {name: load(name) for name in settings.policies}
    wanted = scenario_names() if settings.scenarios == ("all",) else settings.scenarios
    rows = []
    for scenario in wanted:
        reference: Results | None = None
        for name, policy in policies.items():
            results = evaluate(
                policy, scenario, settings.episodes, settings.seed, split=settings.split
            )
            file = name.replace("/", "_").replace(":", "_")
            results.write(settings.out / f"{scenario}-{file}.csv")
            rows.append({"scenario": scenario, "policy": name, **summary(results, reference)})
            reference = reference or results
    stated = {"seed": settings.seed, "split": settings.split, "episodes": settings.episodes}
    plain = [
        {k: v.to_dict() if isinstance(v, Estimate) else v for k, v in row.items()} for row in rows
    ]
    text = json.dumps({**stated, "comparison": plain}, indent=2)
    (settings.out / "summary.json").write_text(text + "\n")
    return rows


def summary(results: Results, reference: Results | None) -> dict[str, Estimate | None]:
    """Return the estimates of one policy on one scenario; differences are to the reference."""
    score = results["score"]
    return {
        "score": mean(score),
        "interquartile_mean": interquartile_mean(score),
        "bound": mean(results["bound"]),
        "settled": share(results.settled),
        "no_contact": share(results.contacts == 0),
        "difference": None if reference is None else paired_difference(score, reference["score"]),
        "improvement": None
        if reference is None
        else probability_of_improvement(score, reference["score"]),
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Compare policies and print the table."""
    settings = tyro.cli(Settings, prog="posse compare", args=arguments)
    rows = compare(settings)
    table = Table(
        title=f"{settings.episodes:,} worlds each, split {settings.split}, seed {settings.seed}; "
        f"95 % intervals; differences are to {settings.policies[0]}, world by world"
    )
    columns = ("score", "settled", "no_contact", "difference", "improvement")
    for column in ("scenario", "policy"):
        table.add_column(column, overflow="fold", min_width=len(column) + 2)
    for column in columns:
        table.add_column(column.replace("_", " "))
    for row in rows:
        cells = [str(row[column]) if row[column] is not None else "" for column in columns]
        table.add_row(row["scenario"], row["policy"], *cells)
    console = Console()
    console.print(table)
    console.print(f"rows and summary: {settings.out}")
