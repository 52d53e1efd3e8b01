"""``posse league``: train trackers and targets in turns against each other's past."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass

import tyro
from rich.console import Console

from posse_training.cluster.settings import RayOption, how_to_resume, of_option, work_of
from posse_training.errors import require
from posse_training.league.settings import LeagueSettings


@dataclass(frozen=True)
class _League:
    settings: tyro.conf.OmitArgPrefixes[LeagueSettings]
    ray: RayOption = None
    """Play the pairs, and train the best responses, on a Ray cluster, with the same result: --ray
    ADDRESS, or --ray alone for the cluster of this machine, or else all its cores. Extra:
    cluster."""


def main(arguments: Sequence[str]) -> None:
    """Play a league, and print its matrix."""
    which = tyro.cli(
        _League,
        prog="posse league",
        description="Train trackers and targets in turns against the other side's past. The same "
        "command again resumes a league.",
        args=arguments,
    )
    require("training", "torch", "stable_baselines3", "matplotlib")
    from posse_training.league.figure import draw_matrix
    from posse_training.league.league import play_league
    from posse_training.league.results import tables

    settings = which.settings
    cluster = of_option(which.ray, work_of(settings.path))
    with how_to_resume(("--folder",)):
        found = play_league(settings, ray=cluster or False)
    console = Console(width=None if sys.stdout.isatty() else 240)
    for table in tables(found):
        console.print(table)
    for path in draw_matrix(found):
        print(path)
