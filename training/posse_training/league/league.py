"""``posse league``: generations, the cross-play of all, and best responses."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass

from rich.console import Console

from posse_training.cluster.settings import Cluster, as_cluster
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
from posse_training.league.work import Pair, Work


def play_league(
    settings: LeagueSettings, *, console: Console | None = None, ray: bool | str | Cluster = False
) -> League:
    """Train the generations that are missing, play all against all, train best responses.

    Everything is kept in the folder; a league that was interrupted at any moment ends as one that
    was not.

    Args:
        settings: All that the result depends on.
        console: Where to show progress.
        ray: Play the pairs, and train the best responses, on a Ray cluster, as in
            :func:`posse_training.evaluate`; with the same result.

    Raises:
        PolicyError, ScenarioError: An unknown policy or scenario; nothing is made.
        MissingExtraError: Ray is to be used and not installed; nothing is made.
        ClusterError: There is no such cluster, or the workers of one shard died again and again.
        RunFolderError: The folder is in use, or has a league of other settings.
        CheckpointError: A checkpoint cannot be written or read.
    """
    settings.check()
    shown = console or Console()
    with _work(settings, shown, as_cluster(ray)) as work:
        try:
            with locked(settings.path):
                keep(settings)
                return _League(settings, work).play()
        except InUseError as error:
            raise RunFolderError(f"league {error}: wait for it, or choose another --folder") from error


@contextlib.contextmanager
def _work(settings: LeagueSettings, console: Console, cluster: Cluster | None) -> Iterator[Work]:
    """Yield what plays and trains: this process, or a cluster."""
    if cluster is None:
        yield Work(settings, console)
        return
    from posse_training.cluster.ray_backend import RayBackend
    from posse_training.league.on_cluster import ClusterWork

    with RayBackend(cluster, log=True) as backend:
        yield ClusterWork(settings, console, cluster, backend)


@dataclass
class _League:
    settings: LeagueSettings
    work: Work

    def play(self) -> League:
        s = self.settings
        for generation in range(1, s.generations + 1):
            for side in (TARGET, TEAM):
                self._generation(side, generation)
        played = CrossPlay(s, self.work)
        teams, targets = (members(s, side, s.generations) for side in (TEAM, TARGET))
        cells = played.cells([(team, target) for team in teams for target in targets])
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
            parts = shares(difficulties(self.work, side, own[-1], others), others[-1].policy)
        steps = s.target_steps if side == TARGET else s.team_steps
        run = training(s, side, trained, against(parts), steps, latest(own))
        self.work.train({trained.label: run})

    def _exploit(self, played: CrossPlay, teams: list[Member], targets: list[Member]) -> list[Exploited]:
        """Train best responses to the last members, or to all, and say what they gain."""
        s = self.settings
        first = {"none": s.generations, "last": s.generations - 1, "all": 0}[s.responses]
        asked = [
            (side, to, response(s, side, to), others)
            for side, of, others in ((TARGET, teams, targets), (TEAM, targets, teams))
            for to in [m for m in of if m.run is not None][first:]
        ]
        self.work.train(
            {
                best.label: training(s, side, best, to.policy, s.response_steps, latest(others))
                for side, to, best, others in asked
                if not best.trained
            }
        )
        after = played.cells([_pair(side, to, best) for side, to, best, _ in asked])
        found = []
        for (side, to, _, others), gained in zip(asked, after, strict=True):
            known = played.cells([_pair(side, to, other) for other in others])
            # The strongest known opponent: a target's lowest score, a team's highest.
            pick = min if side == TARGET else max
            before = pick(known, key=lambda cell: cell.score.value)
            found.append(Exploited(OTHER[side], to.label, before, gained))
        return found


def _pair(side: str, to: Member, other: Member) -> Pair:
    """Return a member and its opponent, of a side, as a team and a target."""
    return (to, other) if side == TARGET else (other, to)
