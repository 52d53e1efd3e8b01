"""``posse league``: train trackers and targets in turns against each other's past."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import tyro
from rich.console import Console

from posse_training.errors import require
from posse_training.league.settings import LeagueSettings


def main(arguments: Sequence[str]) -> None:
    """Play a league, and print its matrix."""
    settings = tyro.cli(
        LeagueSettings,
        prog="posse league",
        description="Train trackers and targets in turns against the other side's past. The same "
        "command again resumes a league.",
        args=arguments,
    )
    require("training", "torch", "stable_baselines3", "matplotlib")
    from posse_training.league.figure import draw_matrix
    from posse_training.league.league import play_league
    from posse_training.league.results import tables

    try:
        found = play_league(settings)
    except KeyboardInterrupt:
        print("\nto resume: run the same command again", file=sys.stderr)
        raise
    console = Console(width=None if sys.stdout.isatty() else 240)
    for table in tables(found):
        console.print(table)
    for path in draw_matrix(found):
        print(path)
