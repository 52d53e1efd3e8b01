"""The teams and targets of a league, and the trainings that they come from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from posse_training.league.settings import LeagueSettings, label_of
from posse_training.runs.defaults import default_settings
from posse_training.runs.saved.folder import BEST, LAST, SETTINGS
from posse_training.runs.settings import TrainSettings, read_settings

TEAM: Final = "trackers"
TARGET: Final = "target"
OTHER: Final = {TEAM: TARGET, TARGET: TEAM}
_SHARES: Final = 8
"""Parts that the worlds are divided into among the opponents, about."""


@dataclass(frozen=True)
class Member:
    """A team or a target.

    Attributes:
        label: Its name in tables.
        policy: What loads it: a name or a file.
        run: The folder of its training; ``None``: it was there at the beginning.
    """

    label: str
    policy: str
    run: Path | None = None

    @property
    def trained(self) -> bool:
        """Whether its training has ended, or it needed none."""
        return self.run is None or (self.run / LAST).is_file()


def founders(settings: LeagueSettings, side: str) -> list[Member]:
    """Return the teams or targets at the beginning."""
    names = settings.teams if side == TEAM else settings.targets
    return [Member(label_of(name), name) for name in names]


def member(settings: LeagueSettings, side: str, generation: int) -> Member:
    """Return the team or target of a generation, from 1."""
    run = settings.path / f"generation-{generation:02d}" / side
    return Member(f"{side}-{generation}", str(run / BEST), run)


def members(settings: LeagueSettings, side: str, generations: int) -> list[Member]:
    """Return the founders of a side and those of its first generations."""
    later = [member(settings, side, k) for k in range(1, generations + 1)]
    return [*founders(settings, side), *later]


def response(settings: LeagueSettings, side: str, to: Member) -> Member:
    """Return the best response of a side to one member of the other."""
    run = settings.path / "responses" / f"{side}-to-{to.label}"
    return Member(f"response to {to.label}", str(run / BEST), run)


def shares(difficulties: Mapping[str, float], latest: str) -> dict[str, int]:
    """Return how many of about eight parts of the worlds each opponent gets.

    In proportion to its difficulty, in [0, 1]; the latest opponent gets one at least.
    """
    total = sum(difficulties.values()) or 1.0
    parts = {name: round(_SHARES * d / total) for name, d in difficulties.items()}
    parts[latest] = max(1, parts[latest])
    return {name: part for name, part in parts.items() if part}


def against(parts: Mapping[str, int]) -> str:
    """Return opponents and their shares as the setting ``against`` has them."""
    return ",".join(name for name, part in parts.items() for _ in range(part))


def training(
    settings: LeagueSettings, side: str, trained: Member, opponents: str, steps: int, start: Member | None
) -> TrainSettings:
    """Return the settings of a member's training; ``start``: whose networks it begins with.

    They are those of its folder if it has begun.
    """
    assert trained.run is not None
    if (trained.run / SETTINGS).is_file():
        return replace(read_settings(trained.run / SETTINGS), folder=trained.run)
    values = default_settings(settings.scenario, side=side).to_dict()
    begun = start is not None and start.run is not None
    fresh: dict[str, Any] = {"imitate": None} if begun else {}
    return TrainSettings.from_dict(
        {
            **values,
            "steps": steps,
            "seed": settings.seed,
            "overrides": settings.overrides,
            "against": opponents,
            "start": str(start.run) if begun and start is not None else None,
            "folder": str(trained.run),
            "evaluate_every": max(1, steps // 4),
            "checkpoint_every": max(1, steps // 8),
            "tensorboard": False,
            "beside": None,
            **fresh,
            **settings.training,
        }
    )


def latest(found: Sequence[Member]) -> Member | None:
    """Return the latest member that was trained; ``None``: there is none."""
    return next((m for m in reversed(found) if m.run is not None), None)
