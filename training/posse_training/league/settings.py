"""The settings of a league, and how they are kept in its folder."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal

from posse import get_scenario
from posse_baselines import load, load_target
from posse_baselines.files import write_atomically
from posse_training.errors import RunFolderError, SettingsError
from posse_training.files import read_json

FILE: Final = "league.json"
_FREE: Final = ("generations", "responses", "response_steps", "episodes", "folder")
"""Settings that the command that resumes a league may change."""


@dataclass(frozen=True, kw_only=True)
class LeagueSettings:
    """Settings of a league. The same command again resumes one.

    Raises:
        SettingsError: A value out of its range.
    """

    scenario: str = "duel"
    """Scenario of all plays."""
    generations: int = 8
    """Generations in all: in each a target is trained, then a team."""
    opponents: Literal["pfsp", "fictitious"] = "pfsp"
    """How the worlds are divided among the other side's past. fictitious: evenly; pfsp: an opponent
    that is harder for the present policy gets more."""
    teams: tuple[str, ...] = ("ddcs-tuned",)
    """Teams at the beginning: names or files."""
    targets: tuple[str, ...] = ("smart",)
    """Targets at the beginning: names or files."""
    target_steps: int = 2_000_000
    """Steps of each target's training."""
    team_steps: int = 4_000_000
    """Steps of each team's training, of one tracker each."""
    responses: Literal["last", "all", "none"] = "last"
    """For which generations a best response is trained, which says how much it can be exploited."""
    response_steps: int = 2_000_000
    """Steps of the training of a best response."""
    episodes: int = 200
    """Test worlds of each pair of a team and a target."""
    seed: int = 1
    """Seed of the trainings."""
    overrides: dict[str, bool | int | float | str] = field(default_factory=dict)
    """Settings of the scenario to change, by name."""
    training: dict[str, bool | int | float | str] = field(default_factory=dict)
    """Settings of the trainings to change, by name, such as num_worlds."""
    folder: Path | None = None
    """Folder; default: runs/league/SCENARIO."""

    def __post_init__(self) -> None:
        for name, least in (
            ("generations", 1),
            ("target_steps", 1),
            ("team_steps", 1),
            ("response_steps", 1),
            ("episodes", 2),
            ("seed", 0),
        ):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or value < least:
                raise SettingsError(f"{name}={value!r:.80} must be a whole number of {least} or more")
        for name in ("teams", "targets"):
            named = getattr(self, name)
            if not named or any("," in each or not each for each in named):
                raise SettingsError(f"{name}={named!r:.80} must name one or more, without commas")
            labels = [label_of(each) for each in named]
            if len(set(labels)) < len(labels):
                raise SettingsError(
                    f"{name}={named!r:.80} must have different names: rename the files of those "
                    "that have the same one, or leave one out"
                )
        if "," in str(self.path):
            raise SettingsError(f"the folder {str(self.path)!r:.80} must have no comma in its name")

    @property
    def path(self) -> Path:
        """The folder that the league is kept in."""
        return self.folder or Path("runs/league") / self.scenario

    def check(self) -> None:
        """Raise if a policy or the scenario is unknown.

        Raises:
            PolicyError, ScenarioError: The message names it.
        """
        get_scenario(self.scenario, **self.overrides)
        for name in self.teams:
            load(name)
        for name in self.targets:
            load_target(name)

    def to_dict(self) -> dict[str, Any]:
        """Return the settings as plain values, without the folder."""
        values = json.loads(json.dumps({**dataclasses.asdict(self), "folder": None}))
        return {name: value for name, value in values.items() if name != "folder"}


def label_of(name: str) -> str:
    """Return how tables name a founder: its name, or that of its file."""
    return Path(name).stem if Path(name).suffix else name


def keep(settings: LeagueSettings) -> None:
    """Write the settings to the league's folder, or check that they are those that it has.

    Raises:
        RunFolderError: The folder has a league of other settings, or cannot be read.
    """
    path, mine = settings.path / FILE, settings.to_dict()
    if path.is_file():
        try:
            theirs = read_json(path)
            differing = [n for n in mine if n not in _FREE and mine[n] != theirs[n]]
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise RunFolderError(f"{path} is damaged: {error!r:.200}") from error
        if differing:
            shown = ", ".join(f"{n}={theirs[n]!r:.60}" for n in differing)
            raise RunFolderError(
                f"{settings.path} has a league with {shown}: go on with these, or choose another --folder"
            )
    write_atomically(path, (json.dumps(mine, indent=2) + "\n").encode())
