"""Plays a league's pairs and makes its trainings, in this process."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from rich.console import Console

from posse import get_scenario
from posse_training.league.members import Member
from posse_training.league.settings import LeagueSettings
from posse_training.reports.evaluation import evaluate
from posse_training.reports.results import Results
from posse_training.runs.saved.folder import SETTINGS
from posse_training.runs.settings import TrainSettings
from posse_training.runs.train import train

Pair = tuple[Member, Member]
"""A team and a target."""


class Work:
    """Plays pairs and trains members, one after the other.

    Args:
        settings: Of the league.
        console: Where to show progress.
    """

    def __init__(self, settings: LeagueSettings, console: Console) -> None:
        self.scenario = get_scenario(settings.scenario, **settings.overrides)
        self.console = console

    def play(self, pairs: Sequence[Pair], episodes: int, seed: int, split: str) -> Iterator[Results]:
        """Yield the results of each pair, in their order."""
        for team, target in pairs:
            self.console.print(f"playing {team.label} against {target.label}", markup=False)
            yield evaluate(
                team.policy, self.scenario, episodes, seed, target=target.policy, split=split, progress=False
            )

    def train(self, runs: Mapping[str, TrainSettings]) -> None:
        """Make trainings that do not depend on each other, by label, or go on with them."""
        for label, run in runs.items():
            self.console.print(f"{label}: {run.run_folder}", markup=False)
            train(run, console=self.console, resume=(run.run_folder / SETTINGS).is_file())
