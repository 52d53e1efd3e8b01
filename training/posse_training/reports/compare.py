"""``posse compare``: policies on the same worlds, with intervals and paired differences."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import tyro
from rich.console import Console

from posse import Batch, get_scenario, scenario_names
from posse_baselines import PolicyError
from posse_training.errors import SettingsError
from posse_training.reports.comparison import Comparison, summary, table, write_summary
from posse_training.reports.comparison_folder import FileNames, replaced
from posse_training.reports.contenders import Contender, read_contenders
from posse_training.reports.evaluation import refuse_trained_split
from posse_training.reports.marl_eval import write_marl_eval
from posse_training.reports.players import PlayError, Players
from posse_training.reports.plays import Plays
from posse_training.reports.sweeps import LEADER_LOSS, SWEEPS, play_sweeps, write_points

PLANNER: Final = "planner"
"""The reference that is shown with every team."""
SUMMARY: Final = "summary.json"
POINTS: Final = "sweeps.csv"
MARL_EVAL: Final = "marl-eval.json"


@dataclass(frozen=True)
class Settings:
    """Arguments of ``posse compare``."""

    policies: Annotated[tuple[str, ...], tyro.conf.Positional]
    """Names, files, package.module:Class, or LABEL=FILE,FILE,... for several training seeds of one
    policy; the first is the baseline of differences."""
    scenarios: tuple[str, ...] = ("all",)
    """Names of scenarios, or "all"."""
    episodes: int = 1000
    """Worlds for each policy and scenario."""
    seed: int = 7
    """Seed of the worlds."""
    split: str = "test"
    """Split of the worlds: train, validation or test."""
    out: Path = Path("runs/compare")
    """Folder for the rows (CSV), the summary (JSON) and the figures (PNG and SVG). It is replaced
    as a whole at the end, and refused if it contains files that no comparison wrote."""
    figures: bool = True
    """Draw figures."""
    planner_episodes: int = 100
    """Largest number of the worlds that the planner plays as a reference; 0: none. It takes about
    0.4 s of processor time per world. If named among the policies, it plays all worlds."""
    sweep_episodes: int = 200
    """Worlds at each point of the figures that vary a setting; 0: omit these figures."""
    export: tuple[Literal["marl-eval"], ...] = ()
    """Further files to write beside the summary: "marl-eval" for marl-eval.json, which marl-eval
    and rliable read."""
    time_limit: float = 1800.0
    """Time limit of a policy on one scenario, for each training seed, s; a policy that exceeds it
    is stopped and skipped on the remaining scenarios."""


def compare(settings: Settings) -> Comparison:
    """Evaluate all policies; write rows, summary and figures.

    A policy that is incompatible with a scenario is omitted there; one that fails is listed under
    ``failed``. The other policies are not affected.

    Raises:
        SettingsError: No episodes to play, or an invalid time limit.
        PolicyError: An unknown policy, or none; nothing is played.
        ScenarioError: An unknown scenario or split, an invalid seed; nothing is played.
        TrainedSplitError: A split that a policy was trained on; nothing is played.
        ComparisonError: The folder cannot be replaced; what it held is unchanged.
    """
    scenarios = _check(settings)
    contenders = read_contenders(settings.policies)
    if settings.planner_episodes > 0 and PLANNER not in settings.policies:
        contenders += read_contenders((PLANNER,))
    for contender in contenders:
        for policy in contender.policies:
            if not isinstance(policy, str):
                refuse_trained_split(policy, settings.split)
    with Players(settings.time_limit) as players:
        for contender in contenders:
            players.check(contender)
        with replaced(settings.out) as folder:
            run = _Run(settings, players, contenders, folder)
            for scenario in scenarios:
                run.play_scenario(scenario)
            if settings.figures:
                run.draw()
            if "marl-eval" in settings.export:
                write_marl_eval(run.found, folder / MARL_EVAL)
            write_summary(run.found, folder / SUMMARY, settings)
    return run.found


def _check(settings: Settings) -> tuple[str, ...]:
    """Return the names of the scenarios.

    Raises:
        SettingsError, ScenarioError: As :func:`compare`.
    """
    for name, least in (("episodes", 1), ("sweep_episodes", 0), ("planner_episodes", 0)):
        value = getattr(settings, name)
        if not least <= value <= 10**8:
            raise SettingsError(f"{name}={value:g} must be at least {least} and at most 10**8")
    if not (math.isfinite(settings.time_limit) and settings.time_limit > 0):
        raise SettingsError(f"time_limit={settings.time_limit!r} s must be finite and above 0")
    named = scenario_names() if settings.scenarios == ("all",) else settings.scenarios
    for name in named:
        Batch(get_scenario(name), 1, seed=settings.seed, split=settings.split)
    return tuple(dict.fromkeys(named))


class _Run:
    """One comparison while it is played and written."""

    def __init__(
        self,
        settings: Settings,
        players: Players,
        contenders: Sequence[Contender],
        folder: Path,
    ) -> None:
        self.settings = settings
        self.contenders = contenders
        self.folder = folder
        self.found = Comparison(contenders[0].label)
        self._players = players
        self._names = FileNames(SUMMARY, POINTS, MARL_EVAL)

    def _play(self, contender: Contender, scenario: str, episodes: int) -> Plays | None:
        return self.attempt(contender, scenario, episodes, scenario)

    def attempt(
        self, contender: Contender, scenario: str, episodes: int, what: str, **overrides: Any
    ) -> Plays | None:
        """Play; return ``None`` and note why if the contender cannot or fails."""
        s = self.settings
        if contender.label == PLANNER and PLANNER not in s.policies:
            episodes = min(episodes, s.planner_episodes)
        try:
            return self._players.play(
                contender, get_scenario(scenario, **overrides), episodes, s.seed, s.split
            )
        except PolicyError as error:
            self.found.left_out.append({"policy": contender.label, "what": what, "why": str(error)})
        except PlayError as error:
            self.found.failed.append({"policy": contender.label, "what": what, "why": str(error)})
        return None

    def play_scenario(self, scenario: str) -> None:
        """Play one scenario with every contender, and write the rows."""
        reference: Plays | None = None
        for contender in self.contenders:
            plays = self._play(contender, scenario, self.settings.episodes)
            if plays is None:
                continue
            self.found.plays[scenario, contender.label] = plays
            self.found.rows.append(
                {
                    "scenario": scenario,
                    "policy": contender.label,
                    **summary(plays, reference),
                    "files": self._write(scenario, plays),
                }
            )
            if contender is self.contenders[0]:
                reference = plays
        best = self.found.plays.get((scenario, PLANNER))
        for row in self.found.rows:
            if row["scenario"] == scenario and best is not None:
                row["of_planner"] = self.found.plays[scenario, row["policy"]].ratio(best)

    def _write(self, scenario: str, plays: Plays) -> list[str]:
        """Write the rows of a contender, one file for each training seed; return their names."""
        written = []
        for k, results in enumerate(plays.results):
            member = f"-{k + 1}" if len(plays.results) > 1 else ""
            stem = self._names.stem(f"{scenario}-{plays.label}{member}", ".csv", ".json")
            results.write(self.folder / f"{stem}.csv")
            written.append(f"{stem}.csv")
        return written

    def draw(self) -> None:
        """Evaluate the sweeps of the figures, and draw the figures."""
        from posse_training.reports.pictures import (
            figures,  # imports matplotlib, which is slow
        )

        found, settings = self.found, self.settings
        losses = [plays for (name, _), plays in found.plays.items() if name == LEADER_LOSS]
        if settings.sweep_episodes > 0:
            episodes = settings.sweep_episodes
            ordered = sorted(self.contenders, key=lambda contender: contender.label == PLANNER)
            found.points = play_sweeps(
                ordered,
                lambda contender, sweep, value: self.attempt(
                    contender, sweep.scenario, episodes, f"{sweep.name} {value:g}",
                    **{sweep.setting: value},
                ),
                SWEEPS,
            )  # fmt: skip
            write_points(self.folder / POINTS, found.points)
            if not losses:
                played = [self._play(c, LEADER_LOSS, episodes) for c in self.contenders]
                losses = [plays for plays in played if plays is not None]
        drawn = figures.draw(self.folder, found.plays, found.points, losses)
        found.figures = [settings.out / path.name for path in drawn]


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare policies, print the table, and return 1 if a policy failed, else 0."""
    settings = tyro.cli(Settings, prog="posse compare", args=arguments)
    found = compare(settings)
    # Where lines have no end (a pipe, a file) the table is as wide as it needs to be.
    console = Console(width=None if sys.stdout.isatty() else 240)
    console.print(table(found, settings))
    for row in found.left_out:
        line = f"left out: {row['policy']} on {row['what']}: {row['why']}"
        console.print(line, markup=False)
    for row in found.failed:
        console.print(f"failed: {row['policy']} on {row['what']}: {row['why']}", markup=False)
    console.print(f"rows and summary: {settings.out}", markup=False)
    if found.figures:
        names = ", ".join(path.stem for path in found.figures if path.suffix == ".png")
        console.print(f"figures (PNG and SVG) beside them: {names}")
    return 1 if found.failed else 0
