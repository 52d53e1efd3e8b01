"""Teams against targets: what each pair scores, kept in the folder once it is known."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from rich.console import Console

from posse import get_scenario
from posse_baselines.learned.policy_file import write_atomically
from posse_training.league.members import TARGET, Member
from posse_training.league.settings import LeagueSettings
from posse_training.reports.evaluation import evaluate
from posse_training.reports.results import Results
from posse_training.reports.statistics import Estimate

TEST_SEED: Final = 7
CHOICE_SEED: Final = 1
CHOICE_WORLDS: Final = 32
"""Validation worlds by which opponents are weighed (pfsp)."""


@dataclass(frozen=True)
class Cell:
    """What a team scores against a target.

    Attributes:
        team: Label of the team.
        target: Label of the target.
        score: Score of the team.
        safe_score: Its safe score.
        contact_free: Share of the episodes.
    """

    team: str
    target: str
    score: Estimate
    safe_score: Estimate
    contact_free: Estimate

    def to_dict(self) -> dict[str, Any]:
        """Return the cell as plain values."""
        estimates = {name: getattr(self, name).to_dict() for name in _ESTIMATES}
        return {"team": self.team, "target": self.target, **estimates}


_ESTIMATES: Final = ("score", "safe_score", "contact_free")


def play_pair(
    settings: LeagueSettings, team: Member, target: Member, episodes: int, seed: int, split: str
) -> Results:
    """Play worlds with a team against a target."""
    scenario = get_scenario(settings.scenario, **settings.overrides)
    return evaluate(
        team.policy, scenario, episodes, seed, target=target.policy, split=split, progress=False
    )


def difficulties(
    settings: LeagueSettings, side: str, own: Member, others: Sequence[Member]
) -> dict[str, float]:
    """Return how hard each opponent is for a member, in [0, 1], by what loads it.

    For a team 1 less its score; for a target the team's score.
    """
    found = {}
    for other in others:
        pair = (other, own) if side == TARGET else (own, other)
        played = play_pair(settings, *pair, CHOICE_WORLDS, CHOICE_SEED, "validation")
        score = float(played["score"].mean())
        found[other.policy] = score if side == TARGET else 1 - score
    return found


class CrossPlay:
    """Plays pairs on the test worlds; what was played is read from the league's folder.

    Args:
        settings: Of the league.
        console: Where to show progress.
    """

    def __init__(self, settings: LeagueSettings, console: Console) -> None:
        self._settings = settings
        self._console = console
        self._folder = settings.path / "cross-play"

    def all(self, teams: Sequence[Member], targets: Sequence[Member]) -> list[Cell]:
        """Return what every team scores against every target."""
        return [self.cell(team, target) for team in teams for target in targets]

    def cell(self, team: Member, target: Member) -> Cell:
        """Return what a team scores against a target."""
        name = f"{team.label}-{target.label}".replace(" ", "-").replace("/", "-")
        path = self._folder / f"{name}-{self._settings.episodes}.json"
        if path.is_file():
            return _read(json.loads(path.read_text(encoding="utf-8")))
        self._console.print(f"playing {team.label} against {target.label}", markup=False)
        played = play_pair(self._settings, team, target, self._settings.episodes, TEST_SEED, "test")
        estimates = {name: played.estimate(name) for name in _ESTIMATES}
        found = Cell(team.label, target.label, **estimates)
        path.parent.mkdir(exist_ok=True)
        write_atomically(path, (json.dumps(found.to_dict(), indent=2) + "\n").encode())
        return found


def _read(values: dict[str, Any]) -> Cell:
    estimates = {name: Estimate(**values[name]) for name in _ESTIMATES}
    return Cell(values["team"], values["target"], **estimates)
