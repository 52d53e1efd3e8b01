"""Teams against targets: what each pair scores, kept in the folder once it is known."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from posse_baselines.files import write_atomically
from posse_training.files import read_json
from posse_training.league.members import TARGET, Member
from posse_training.league.settings import LeagueSettings
from posse_training.league.work import Pair, Work
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


def difficulties(work: Work, side: str, own: Member, others: Sequence[Member]) -> dict[str, float]:
    """Return how hard each opponent is for a member, in [0, 1], by what loads it.

    For a team 1 less its score; for a target the team's score.
    """
    pairs = [(other, own) if side == TARGET else (own, other) for other in others]
    found = {}
    played = work.play(pairs, CHOICE_WORLDS, CHOICE_SEED, "validation")
    for other, results in zip(others, played, strict=True):
        score = float(results["score"].mean())
        found[other.policy] = score if side == TARGET else 1 - score
    return found


class CrossPlay:
    """What pairs score on the test worlds; those that were played are read from the folder.

    Args:
        settings: Of the league.
        work: Plays the others.
    """

    def __init__(self, settings: LeagueSettings, work: Work) -> None:
        self._episodes = settings.episodes
        self._folder = settings.path / "cross-play"
        self._work = work

    def cells(self, pairs: Sequence[Pair]) -> list[Cell]:
        """Return what the team of each pair scores against its target."""
        missing = [pair for pair in pairs if not self._path(pair).is_file()]
        played = self._work.play(missing, self._episodes, TEST_SEED, "test")
        for pair, results in zip(missing, played, strict=True):
            team, target = pair
            estimates = {name: results.estimate(name) for name in _ESTIMATES}
            found = Cell(team.label, target.label, **estimates)
            path = self._path(pair)
            path.parent.mkdir(exist_ok=True)
            write_atomically(path, (json.dumps(found.to_dict(), indent=2) + "\n").encode())
        return [_read(self._path(pair)) for pair in pairs]

    def _path(self, pair: Pair) -> Path:
        team, target = pair
        name = f"{team.label}-{target.label}".replace(" ", "-").replace("/", "-")
        return self._folder / f"{name}-{self._episodes}.json"


def _read(path: Path) -> Cell:
    values = read_json(path)
    estimates = {name: Estimate(**values[name]) for name in _ESTIMATES}
    return Cell(values["team"], values["target"], **estimates)
