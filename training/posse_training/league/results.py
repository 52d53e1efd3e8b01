"""The results of a league: a matrix as table, CSV, JSON and figure, and what can be exploited."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from rich.table import Table

from posse_baselines.files import write_atomically
from posse_training.league.cross_play import Cell
from posse_training.league.members import TARGET, TEAM, Member
from posse_training.league.settings import LeagueSettings

MATRIX: Final = "matrix.csv"
SUMMARY: Final = "summary.json"


@dataclass(frozen=True)
class Exploited:
    """What a best response gains against a member.

    Attributes:
        side: The member's side.
        label: The member's label.
        before: Its play against the strongest opponent of the league.
        after: Its play against the best response.
    """

    side: str
    label: str
    before: Cell
    after: Cell

    @property
    def gain(self) -> float:
        """By how much the response moves the team's score in its own favour."""
        change = self.after.score.value - self.before.score.value
        return -change if self.side == TEAM else change


@dataclass(frozen=True)
class League:
    """All results of a league."""

    settings: LeagueSettings
    teams: list[Member]
    targets: list[Member]
    cells: list[Cell]
    exploited: list[Exploited]

    def at(self, team: str, target: str) -> Cell:
        """Return what a team scores against a target, by their labels."""
        return next(c for c in self.cells if (c.team, c.target) == (team, target))

    def worst(self, team: str) -> Cell:
        """Return a team's play against its strongest target."""
        return min((c for c in self.cells if c.team == team), key=lambda c: c.score.value)

    def hardest(self, target: str) -> Cell:
        """Return a target's play against its strongest team."""
        return max((c for c in self.cells if c.target == target), key=lambda c: c.score.value)


def write_results(found: League) -> None:
    """Write matrix and summary to the league's folder."""
    folder = found.settings.path
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(["team", "target", "score", "low", "high", "safe_score", "contact_free", "episodes"])
    for c in found.cells:
        s = c.score
        values = [s.value, s.low, s.high, c.safe_score.value, c.contact_free.value]
        writer.writerow([c.team, c.target, *(f"{v:.4f}" for v in values), s.count])
    write_atomically(folder / MATRIX, text.getvalue().encode())
    summary: dict[str, Any] = {
        "settings": found.settings.to_dict(),
        "cells": [cell.to_dict() for cell in found.cells],
        "exploited": [
            {"side": e.side, "label": e.label, "gain": e.gain, "before": e.before.to_dict(), "after": e.after.to_dict()}
            for e in found.exploited
        ],
    }
    write_atomically(folder / SUMMARY, (json.dumps(summary, indent=2) + "\n").encode())


def tables(found: League) -> list[Table]:
    """Return the matrix and what the best responses gain, as tables."""
    matrix = Table(title="score of the team (row) against the target (column), 95 % intervals")
    matrix.add_column("team")
    for target in found.targets:
        matrix.add_column(target.label)
    for team in found.teams:
        cells = (found.at(team.label, target.label) for target in found.targets)
        matrix.add_row(team.label, *(_short(cell) for cell in cells))
    exploited = Table(title="best responses")
    for column in ("member", "strongest opponent so far", "score", "with the response", "gain"):
        exploited.add_column(column)
    opponent: dict[str, Callable[[Cell], str]] = {TEAM: lambda cell: cell.target, TARGET: lambda cell: cell.team}
    for e in found.exploited:
        exploited.add_row(
            e.label, opponent[e.side](e.before), str(e.before.score), str(e.after.score), f"{e.gain:+.3f}"
        )
    return [matrix, exploited] if found.exploited else [matrix]


def _short(cell: Cell) -> str:
    s = cell.score
    return f"{s.value:.2f}\n[{s.low:.2f}, {s.high:.2f}]"
