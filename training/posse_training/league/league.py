"""``posse league``: generations, the cross-play of all, and best responses."""

from __future__ import annotations

from dataclasses import dataclass

from rich.console import Console

from posse_training.errors import RunFolderError
from posse_training.files import InUseError, locked
from posse_training.league.cross_play import CrossPlay, difficulties
from posse_training.league.members import (
    OTHER,
    TARGET,
    TEAM,
    Member,
    against,
    latest,
    member,
    members,
    response,
    shares,
    training,
)
from posse_training.league.results import Exploited, League, write_results
from posse_training.league.settings import LeagueSettings, keep
from posse_training.runs.folder import SETTINGS
from posse_training.runs.train import resume, train


def play_league(settings: LeagueSettings, *, console: Console | None = None) -> League:
    """Train the generations that are missing, play all against all, train best responses.

    Everything is kept in the folder; a league that was interrupted at any moment ends as one that
    was not.

    Args:
        settings: All that the result depends on.
        console: Where to show progress.

    Raises:
        PolicyError, ScenarioError: An unknown policy or scenario; nothing is made.
        RunFolderError: The folder is in use, or has a league of other settings.
        CheckpointError: A checkpoint cannot be written or read.
    """
    settings.check()
    shown = console or Console()
    try:
        with locked(settings.path):
            keep(settings)
            return _League(settings, shown).play()
    except InUseError as error:
        raise RunFolderError(f"league {error}: wait for it, or choose another --folder") from error


@dataclass
class _League:
    settings: LeagueSettings
    console: Console

    def play(self) -> League:
        s = self.settings
        for generation in range(1, s.generations + 1):
            for side in (TARGET, TEAM):
                self._generation(side, generation)
        played = CrossPlay(s, self.console)
        teams, targets = (members(s, side, s.generations) for side in (TEAM, TARGET))
        cells = played.all(teams, targets)
        found = League(s, teams, targets, cells, self._exploit(played, teams, targets))
        write_results(found)
        return found

    def _generation(self, side: str, generation: int) -> None:
        """Train the member of a side, against the other's past and present."""
        s = self.settings
        trained = member(s, side, generation)
        if trained.trained:
            return
        others = members(s, OTHER[side], generation - (side == TARGET))
        own = members(s, side, generation - 1)
        if s.opponents == "fictitious" or len(others) == 1:
            parts = dict.fromkeys((other.policy for other in others), 1)
        else:
            parts = shares(difficulties(s, side, own[-1], others), others[-1].policy)
        steps = s.target_steps if side == TARGET else s.team_steps
        self._train(side, trained, against(parts), steps, latest(own))

    def _train(
        self, side: str, trained: Member, opponents: str, steps: int, start: Member | None
    ) -> None:
        """Train a member, or go on with its training."""
        assert trained.run is not None
        self.console.print(f"{trained.label}: {trained.run}", markup=False)
        if (trained.run / SETTINGS).is_file():
            resume(trained.run, console=self.console)
            return
        settings = training(self.settings, side, trained, opponents, steps, start)
        train(settings, console=self.console)

    def _exploit(
        self, played: CrossPlay, teams: list[Member], targets: list[Member]
    ) -> list[Exploited]:
        """Train best responses to the last members, or to all, and say what they gain."""
        s = self.settings
        found = []
        for side, of, others in ((TARGET, teams, targets), (TEAM, targets, teams)):
            trained = [m for m in of if m.run is not None]
            for to in {"none": [], "last": trained[-1:], "all": trained}[s.responses]:
                best = response(s, side, to)
                if not best.trained:
                    start = latest(others)
                    self._train(side, best, to.policy, s.response_steps, start)
                pair = (to, best) if side == TARGET else (best, to)
                known = [
                    played.cell(*((to, other) if side == TARGET else (other, to)))
                    for other in others
                ]
                # The strongest known opponent: a target's lowest score, a team's highest.
                pick = min if side == TARGET else max
                before = pick(known, key=lambda cell: cell.score.value)
                found.append(Exploited(OTHER[side], to.label, before, played.cell(*pair)))
        return found
