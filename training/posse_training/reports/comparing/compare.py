"""``posse compare``: policies on the same worlds, with intervals and paired differences."""

from __future__ import annotations

import difflib
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final, Literal

import tyro
from rich.console import Console

from posse import Batch, get_scenario, scenario_names
from posse_baselines import load_target
from posse_training.cluster.settings import RayOption, how_to_resume, of_option, work_of
from posse_training.errors import SettingsError
from posse_training.processes import refuse_unguarded
from posse_training.reports.comparing.comparison import Comparison, table, write_summary
from posse_training.reports.comparing.contenders import read_contenders
from posse_training.reports.comparing.folder import replaced
from posse_training.reports.comparing.marl_eval import write_marl_eval
from posse_training.reports.comparing.players import Players
from posse_training.reports.comparing.progress import Progress
from posse_training.reports.comparing.run import MARL_EVAL, PLANNER, REPORT, SUMMARY, ComparisonRun
from posse_training.reports.comparing.sweeps import SWEEPS, Sweep
from posse_training.reports.episodes import refuse_trained_split

_ALL: Final = ("all",)
_PIPED: Final = 240
"""Width of the table where lines have no end (a pipe, a file)."""


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
    """Folder for the report (HTML), the rows (CSV), the summary (JSON) and the figures (PNG and
    SVG). It is replaced as a whole at the end, and refused if it contains files that no comparison
    wrote."""
    figures: bool = True
    """Draw figures, and write the report."""
    replays: int = 3
    """Largest wins, and as many largest losses, of all policies against the first one that the
    report replays; 0: none."""
    planner_episodes: int = 100
    """Largest number of the worlds that the planner plays as a reference; 0: none. It takes about
    0.4 s of processor time per world. If named among the policies, it plays all worlds."""
    sweeps: tuple[str, ...] = ()
    """Settings to vary beyond what was trained with: team-size, radio-loss, target-speed, or "all",
    or "none"; default: all if all scenarios are played, else none."""
    sweep_episodes: int = 200
    """Worlds at each point of the figures that vary a setting; 0: omit these figures."""
    export: tuple[Literal["marl-eval"], ...] = ()
    """Further files to write beside the summary: "marl-eval" for marl-eval.json, which marl-eval
    and rliable read."""
    time_limit: float = 1800.0
    """Time limit of a policy on one scenario, for each training seed, s (with --ray: of a shard of
    500 worlds); a policy that exceeds it is stopped and skipped on the remaining scenarios."""
    ray: RayOption = None
    """Play on a Ray cluster, with the same result: --ray ADDRESS, or --ray alone for the cluster of
    this machine, or else all its cores. Interrupted, the same command resumes. Extra: cluster."""
    target: str | None = None
    """Target that all teams play against: a motion, a learned target, a file or
    package.module:Class; default: the scenario's own."""


def compare(settings: Settings, *, console: Console | None = None) -> Comparison:
    """Evaluate all policies; write rows, summary, figures and report.

    A policy that is incompatible with a scenario is omitted there; one that fails is listed under
    ``failed``. The other policies are not affected.

    Args:
        settings: What to play, and where to write.
        console: Where to show progress; default: the standard error output.

    Raises:
        SettingsError: No episodes to play, an unknown sweep, or an invalid time limit.
        PolicyError: An unknown policy or target, or no policy; nothing is played.
        ScenarioError: An unknown scenario or split, an invalid seed; nothing is played.
        TrainedSplitError: A split that a policy was trained on; nothing is played.
        MissingExtraError: Ray is to be used and not installed.
        ClusterError: There is no such cluster.
        ComparisonError: The folder cannot be replaced; what it held is unchanged.
    """
    refuse_unguarded()
    scenarios, sweeps = _check(settings)
    contenders = read_contenders(settings.policies)
    if settings.planner_episodes > 0 and PLANNER not in settings.policies:
        contenders += read_contenders((PLANNER,))
    for contender in contenders:
        for policy in contender.policies:
            if not isinstance(policy, str):
                refuse_trained_split(policy, settings.split)
    if settings.target is not None:
        refuse_trained_split(load_target(settings.target), settings.split)
    with _players(settings) as players:
        for contender in contenders:
            players.check(contender)
        with replaced(settings.out) as folder:
            run = ComparisonRun(settings, players, contenders, scenarios, sweeps, folder)
            players.expect(run.plays(), settings.seed, settings.split)
            with Progress(*run.planned(), console or Console(stderr=True)) as progress:
                run.play(progress)
                if settings.figures:
                    run.report(progress)
            if "marl-eval" in settings.export:
                write_marl_eval(run.found, folder / MARL_EVAL)
            write_summary(run.found, folder / SUMMARY, settings)
        players.forget()
    return run.found


def _players(settings: Settings) -> Players:
    cluster = of_option(settings.ray, work_of(settings.out))
    if cluster is None:
        return Players(settings.time_limit, settings.target)
    from posse_training.cluster.players import ClusterPlayers

    return ClusterPlayers(settings.time_limit, settings.target, cluster)


def _check(settings: Settings) -> tuple[tuple[str, ...], tuple[Sweep, ...]]:
    """Return the names of the scenarios, and the sweeps.

    Raises:
        SettingsError, ScenarioError: As :func:`compare`.
    """
    for name, least in (("episodes", 1), ("sweep_episodes", 0), ("planner_episodes", 0), ("replays", 0)):
        value = getattr(settings, name)
        if not least <= value <= 10**8:
            raise SettingsError(f"{name}={value:g} must be at least {least} and at most 10**8")
    if not (math.isfinite(settings.time_limit) and settings.time_limit > 0):
        raise SettingsError(f"time_limit={settings.time_limit!r} s must be finite and above 0")
    sweeps = asked_sweeps(settings)
    named = scenario_names() if settings.scenarios == _ALL else settings.scenarios
    for name in named:
        Batch(get_scenario(name), 1, seed=settings.seed, split=settings.split)
    return tuple(dict.fromkeys(named)), sweeps


def asked_sweeps(settings: Settings) -> tuple[Sweep, ...]:
    """Return the sweeps that are asked for; by default all of them with all scenarios.

    Raises:
        SettingsError: An unknown one.
    """
    known = {sweep.name: sweep for sweep in SWEEPS}
    asked = settings.sweeps
    if not asked:
        asked = _ALL if settings.scenarios == _ALL and settings.figures else ("none",)
    if asked in (_ALL, ("none",)):
        asked = tuple(known) if asked == _ALL else ()
    for name in asked:
        if name not in known:
            near = difflib.get_close_matches(name[:80], known, n=1)
            hint = f"did you mean {near[0]!r}? " if near else ""
            raise SettingsError(
                f"sweeps={name!r:.80} is not known: {hint}name some of {', '.join(known)}, or 'all', or 'none'"
            )
    return tuple(known[name] for name in dict.fromkeys(asked)) if settings.sweep_episodes else ()


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare policies, print the table, and return 1 if a policy failed, else 0."""
    settings = tyro.cli(
        Settings,
        prog="posse compare",
        description="Score policies on the same worlds; write tables, figures and a report page.",
        args=arguments,
    )
    with how_to_resume(settings.ray):
        found = compare(settings)
    console = Console(width=None if sys.stdout.isatty() else _PIPED)
    console.print(table(found, settings, console.width))
    for row in found.left_out:
        line = f"left out: {row['policy']} on {row['what']}: {row['why']}"
        console.print(line, markup=False)
    for row in found.failed:
        console.print(f"failed: {row['policy']} on {row['what']}: {row['why']}", markup=False)
    console.print(f"rows and summary: {settings.out}", markup=False, soft_wrap=True)
    if found.figures:
        names = ", ".join(path.stem for path in found.figures if path.suffix == ".png")
        console.print(f"figures (PNG and SVG) beside them: {names}")
    if settings.figures:
        page = settings.out / REPORT
        console.print(f"all of it, to open in a browser: {page}", markup=False, soft_wrap=True)
    return 1 if found.failed else 0
