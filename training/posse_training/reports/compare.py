"""``posse compare``: policies on the same worlds, with intervals and paired differences."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Final

import tyro
from rich.console import Console
from rich.table import Table

from posse import get_scenario, scenario_names
from posse_baselines import PolicyError
from posse_training.reports.contenders import Contender, Plays, play, read_contenders
from posse_training.reports.statistics import Estimate
from posse_training.reports.sweeps import (
    LEADER_LOSS,
    Point,
    play_leader_loss,
    play_sweeps,
    write_points,
)

ORACLE: Final = "oracle"
SUMMARY: Final = "summary.json"


@dataclass(frozen=True)
class Settings:
    """What ``posse compare`` takes."""

    policies: Annotated[tuple[str, ...], tyro.conf.Positional]
    """Names, files, package.module:Class, or LABEL=FILE,FILE,... for the training seeds of one;
    differences are to the first."""
    scenarios: tuple[str, ...] = ("all",)
    """Names of scenarios, or "all"."""
    episodes: int = 1000
    """Worlds for each policy and scenario."""
    seed: int = 7
    """Of the worlds."""
    split: str = "test"
    """Of the worlds: train, validation or test."""
    out: Path = Path("runs/compare")
    """Folder for the rows (CSV), the summary (JSON) and the figures (PNG and SVG); an earlier
    comparison in it is replaced."""
    figures: bool = True
    """Draw figures; the oracle plays, too, as a reference."""
    sweep_episodes: int = 200
    """Worlds at each point of the figures that vary a setting; 0: none of these figures."""


@dataclass
class Comparison:
    """Everything that was played, and who could not play what."""

    reference: str
    """The policy that differences are to."""
    plays: dict[tuple[str, str], Plays] = field(default_factory=dict)
    """By scenario and policy."""
    rows: list[dict[str, Any]] = field(default_factory=list)
    """The estimates of each, as the table shows them."""
    left_out: list[dict[str, str]] = field(default_factory=list)
    """Policy, what it cannot play, and why."""
    points: list[Point] = field(default_factory=list)
    """Of the sweeps."""
    losses: list[Plays] = field(default_factory=list)
    """Of the scenario in which the leader breaks."""
    figures: list[Path] = field(default_factory=list)
    """The files that were drawn."""
    files: list[str] = field(default_factory=list)
    """Names of the files with rows."""

    def leave_out(self, policy: str, what: str, why: str) -> None:
        """Note that a policy cannot play something."""
        self.left_out.append({"policy": policy, "what": what, "why": why})


def compare(settings: Settings) -> Comparison:
    """Play everything; write rows, summary and figures.

    Raises:
        SettingsError: No episodes to play.
        PolicyError: An unknown policy, or none; nothing is played.
        ScenarioError: An unknown scenario or split, an impossible seed; nothing is played.
        TrainedSplitError: A split that a policy was trained on.
    """
    contenders = read_contenders(settings.policies)
    named = scenario_names() if settings.scenarios == ("all",) else settings.scenarios
    for name in named:
        get_scenario(name)
    if settings.figures and ORACLE not in settings.policies:
        contenders += read_contenders((ORACLE,))
    settings.out.mkdir(parents=True, exist_ok=True)
    found = Comparison(contenders[0].label)
    for scenario in named:
        play_scenario(found, scenario, contenders, settings)
    if settings.figures:
        draw(found, contenders, settings)
    write_summary(found, settings)
    return found


def play_scenario(
    found: Comparison, scenario: str, contenders: Sequence[Contender], settings: Settings
) -> None:
    """Play one scenario with everybody who can."""
    reference: Plays | None = None
    for contender in contenders:
        try:
            plays = play(contender, scenario, settings.episodes, settings.seed, settings.split)
        except PolicyError as error:
            found.leave_out(contender.label, scenario, str(error))
            continue
        for k, results in enumerate(plays.results):
            member = f"-{k + 1}" if len(plays.results) > 1 else ""
            label = contender.label.replace("/", "_").replace(":", "_")
            rows = settings.out / f"{scenario}-{label}{member}.csv"
            results.write(rows)
            found.files += [rows.name, rows.with_suffix(".json").name]
        found.plays[scenario, contender.label] = plays
        found.rows.append(
            {"scenario": scenario, "policy": contender.label, **summary(plays, reference)}
        )
        if contender is contenders[0]:
            reference = plays


def draw(found: Comparison, contenders: Sequence[Contender], settings: Settings) -> None:
    """Play what the figures need beside the scenarios, and draw them."""
    from posse_training.reports import figures  # matplotlib takes a while, and only this needs it

    found.losses = [plays for (name, _), plays in found.plays.items() if name == LEADER_LOSS]
    if settings.sweep_episodes > 0:
        worlds = (settings.sweep_episodes, settings.seed, settings.split)
        ordered = sorted(contenders, key=lambda contender: contender.label == ORACLE)
        found.points = play_sweeps(ordered, *worlds, found.leave_out)
        write_points(settings.out / "sweeps.csv", found.points)
        found.files.append("sweeps.csv")
        if not found.losses:
            found.losses = play_leader_loss(contenders, *worlds, found.leave_out)
    found.figures = figures.draw(settings.out, found.plays, found.points, found.losses)


def summary(plays: Plays, reference: Plays | None) -> dict[str, Estimate | int | None]:
    """Return the estimates of one policy on one scenario; differences are to the reference."""
    return {
        "seeds": len(plays.results),
        "score": plays.mean("score"),
        "interquartile_mean": plays.interquartile_mean("score"),
        "bound": plays.mean("bound"),
        "settled": plays.share([result.settled for result in plays.results]),
        "no_contact": plays.share([result.contacts == 0 for result in plays.results]),
        "difference": None if reference is None else plays.difference(reference),
        "improvement": None if reference is None else plays.improvement(reference),
    }


def write_summary(found: Comparison, settings: Settings) -> None:
    """Write all estimates as JSON."""
    rows = [
        {k: v.to_dict() if isinstance(v, Estimate) else v for k, v in row.items()}
        for row in found.rows
    ]
    stated = {"seed": settings.seed, "split": settings.split, "episodes": settings.episodes}
    files = [*found.files, *(path.name for path in found.figures)]
    whole = {**stated, "comparison": rows, "left_out": found.left_out, "files": files}
    for name in former_files(settings.out) - set(files):  # so that two are never mixed
        (settings.out / name).unlink(missing_ok=True)
    (settings.out / SUMMARY).write_text(json.dumps(whole, indent=2) + "\n")


def former_files(folder: Path) -> set[str]:
    """Return the names of the files that an earlier comparison wrote to a folder."""
    try:
        files = json.loads((folder / SUMMARY).read_text()).get("files", [])
    except (OSError, ValueError, AttributeError):  # none, or not one of ours
        return set()
    return {name for name in files if name == Path(name).name}  # in this very folder


def main(arguments: Sequence[str] | None = None) -> None:
    """Compare policies and print the table."""
    settings = tyro.cli(Settings, prog="posse compare", args=arguments)
    found = compare(settings)
    # Where lines have no end (a pipe, a file) the table is as wide as it needs to be.
    console = Console(width=None if sys.stdout.isatty() else 160)
    console.print(table(found, settings))
    for row in found.left_out:
        console.print(f"left out: {row['policy']} on {row['what']}: {row['why']}")
    console.print(f"rows and summary: {settings.out}")
    if found.figures:
        names = ", ".join(path.stem for path in found.figures if path.suffix == ".png")
        console.print(f"figures (PNG and SVG) beside them: {names}")


def table(found: Comparison, settings: Settings) -> Table:
    """Return the estimates as a table."""
    shown = Table(
        title=f"{settings.episodes:,} worlds each, split {settings.split}, seed {settings.seed}; "
        f"95 % intervals; differences are to {found.reference}, world by world"
    )
    columns = ("score", "settled", "no_contact", "difference", "improvement")
    for column in ("scenario", "policy"):
        shown.add_column(column, overflow="fold", min_width=len(column) + 2)
    for column in columns:
        shown.add_column(column.replace("_", " "))
    for row in found.rows:
        cells = [str(row[column]) if row[column] is not None else "" for column in columns]
        many = f" ({row['seeds']} training seeds)" if row["seeds"] > 1 else ""
        shown.add_row(row["scenario"], row["policy"] + many, *cells)
    return shown
