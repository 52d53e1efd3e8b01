"""Results of a comparison: estimates, their table and their summary."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Protocol

from rich import box
from rich.table import Table
from rich.text import Text

from posse_training.reports.comparing.plays import Plays
from posse_training.reports.comparing.sweeps import Point
from posse_training.reports.statistics import Estimate


@dataclass
class Comparison:
    """All results, with the policies that were omitted or failed."""

    reference: str
    """The baseline of the differences."""
    plays: dict[tuple[str, str], Plays] = field(default_factory=dict)
    """By scenario and policy."""
    rows: list[dict[str, Any]] = field(default_factory=list)
    """The estimates of each, and the files of its rows."""
    left_out: list[dict[str, str]] = field(default_factory=list)
    """Policies that do not fit: ``policy``, ``what`` they cannot play, and ``why``."""
    failed: list[dict[str, str]] = field(default_factory=list)
    """Policies that raised, returned invalid actions, crashed or exceeded the time limit."""
    points: list[Point] = field(default_factory=list)
    """Of the sweeps."""
    figures: list[Path] = field(default_factory=list)
    """The files that were drawn."""


class _Worlds(Protocol):
    """Which worlds were played."""

    @property
    def seed(self) -> int: ...
    @property
    def split(self) -> str: ...
    @property
    def episodes(self) -> int: ...
    @property
    def target(self) -> str | None: ...


def summary(plays: Plays, reference: Plays | None) -> dict[str, Estimate | int | float | None]:
    """Return the estimates of one policy on one scenario.

    Differences are of the safe score, to the reference. ``of_planner``, the safe score as a share
    of the planner's, is filled in once that has played.
    """
    return {
        "seeds": len(plays.results),
        "safe_score": plays.mean("safe_score"),
        "of_planner": None,
        "score": plays.mean("score"),
        "contact_free": plays.share([result["contact_free"] == 1 for result in plays.results]),
        "interquartile_mean": plays.interquartile_mean("safe_score"),
        "bound": plays.mean("bound"),
        "settled": plays.share([result.settled for result in plays.results]),
        "difference": None if reference is None else plays.difference(reference),
        "improvement": None if reference is None else plays.improvement(reference),
    }


def write_summary(found: Comparison, path: Path, worlds: _Worlds) -> None:
    """Write all estimates as JSON."""
    rows = [{k: v.to_dict() if isinstance(v, Estimate) else v for k, v in row.items()} for row in found.rows]
    whole = {
        "seed": worlds.seed,
        "split": worlds.split,
        "episodes": worlds.episodes,
        "target": worlds.target,
        "comparison": rows,
        "left_out": found.left_out,
        "failed": found.failed,
    }
    path.write_text(json.dumps(whole, indent=2) + "\n", encoding="utf-8")


_WIDE: Final = 200
"""Columns of a terminal that the whole table needs."""
_LONG: Final = ("safe_score", "of_planner", "score", "contact_free", "bound", "settled", "difference", "improvement")
_SHORT: Final = {
    "safe_score": "safe score",
    "of_planner": "of the\nplanner",
    "contact_free": "contact-\nfree",
    "difference": "difference",
    "improvement": "better\nin",
}
"""Columns that fit into 80 characters, with their headers."""


def table(found: Comparison, worlds: _Worlds, width: int) -> Table:
    """Return the estimates as a table, teams ranked by safe score on each scenario.

    Args:
        found: The results.
        worlds: Which worlds were played.
        width: Columns of the terminal; with fewer than 200, the table has the most important
            estimates only, and each interval stands below its value.
    """
    title = (
        f"{worlds.episodes:,} worlds each, {_target(worlds)}split {worlds.split}, "
        f"seed {worlds.seed}; "
        f"95 % intervals; differences of the safe score to {found.reference}, paired by world"
    )
    played = list(dict.fromkeys(row["scenario"] for row in found.rows))
    ranked = sorted(found.rows, key=lambda row: (played.index(row["scenario"]), -row["safe_score"].value))
    return _long(ranked, title) if width >= _WIDE else _short(ranked, title)


def _long(rows: Sequence[dict[str, Any]], title: str) -> Table:
    shown = Table(title=Text(title))
    for column in ("scenario", "policy"):
        shown.add_column(column, overflow="fold", min_width=len(column) + 2)
    for column in _LONG:
        shown.add_column(column.replace("_", " "))
    for row in rows:
        cells = [_cell(column, row[column]) for column in _LONG]
        shown.add_row(Text(row["scenario"]), Text(_team(row)), *map(Text, cells))
    return shown


def _short(rows: Sequence[dict[str, Any]], title: str) -> Table:
    shown = Table(title=Text(title), box=box.HORIZONTALS, pad_edge=False, collapse_padding=True)
    shown.add_column("policy", overflow="fold")
    for header in _SHORT.values():
        shown.add_column(header, no_wrap=True)
    before = None
    for row in rows:
        if row["scenario"] != before:
            if before is not None:
                shown.add_section()
            shown.add_row(Text(row["scenario"], style="bold", overflow="fold"))
        before = row["scenario"]
        shown.add_row(Text(_team(row)), *(Text(_brief(row[column], column)) for column in _SHORT))
    return shown


def _team(row: dict[str, Any]) -> str:
    many = f" ({row['seeds']} training seeds)" if row["seeds"] > 1 else ""
    return f"{row['policy']}{many}"


def _target(worlds: _Worlds) -> str:
    return "" if worlds.target is None else f"target {worlds.target}, "


def _brief(value: Estimate | float | None, column: str) -> str:
    """Return a cell of the short table; shares of worlds are shown without their interval."""
    if isinstance(value, Estimate):
        if column in ("contact_free", "improvement"):
            return f"{100 * value.value:.1f} %"
        return f"{value.value:.3f}\n[{value.low:.3f}, {value.high:.3f}]"
    return "" if value is None else f"{value:.2f}"


def _cell(column: str, value: Estimate | float | None) -> str:
    """Return a cell of the long table; the bound is shown without its interval."""
    if column == "bound" and isinstance(value, Estimate):
        value = value.value
    if isinstance(value, float):
        return f"{value:.3f}" if column == "bound" else f"{value:.2f}"
    return "" if value is None else str(value)
