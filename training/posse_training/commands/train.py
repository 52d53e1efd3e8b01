"""``posse train``: train a team, once or with several seeds."""

import contextlib
import platform
import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from posse import family_names
from posse.declarations import users_modules
from posse_training.errors import ClusterError, RunFolderError, SettingsError, require
from posse_training.files import check_held
from posse_training.options import Names, Ray, words_of
from posse_training.parallel import all_on_ray, connected
from posse_training.train.algorithms import check_read
from posse_training.train.presets import Preset, default_settings
from posse_training.train.settings import FREE, SETTINGS, TrainSettings, read_settings


@dataclass(frozen=True)
class _Which:
    """What the defaults of all other settings depend on."""

    scenario: Names = "smart"
    algorithm: str | None = None
    side: str = "trackers"
    preset: Preset = "nothing"


@dataclass(frozen=True, kw_only=True)
class _Arguments(TrainSettings):
    """Settings of a training, and how often and where it is made."""

    preset: Preset = "nothing"
    """What is learned: a policy from nothing, or by cmaes a correction of a scripted team."""
    seed: Annotated[int, tyro.conf.Suppress] = 1
    seeds: Annotated[tuple[int, ...], tyro.conf.arg(name="seed")] = (1,)
    """Seed of the worlds, the networks and the exploration; or several for as many runs, in turn, or with --ray at
    once, which the same command resumes."""
    ray: Ray = False
    """Make them on a Ray cluster."""

    @property
    def runs(self) -> list[TrainSettings]:
        """The settings alone, with each seed; a folder that is given holds a subfolder for each of several."""
        if len(set(self.seeds)) < max(1, len(self.seeds)):
            raise SettingsError(f"seed={' '.join(map(str, self.seeds))} names none, or one twice")
        values = {field.name: getattr(self, field.name) for field in fields(TrainSettings)}
        if self.folder is None or len(self.seeds) == 1:
            return [TrainSettings(**{**values, "seed": seed}) for seed in self.seeds]
        return [TrainSettings(**{**values, "seed": k, "folder": self.folder / f"seed-{k}"}) for k in self.seeds]


def main(arguments: Sequence[str]) -> None:
    """Train a team, once or with several seeds; the same command resumes it."""
    asked = [a for a in arguments if a not in ("-h", "--help")]
    which, _ = tyro.cli(_Which, args=asked, return_unknown_args=True)
    default = default_settings(which.scenario, which.algorithm, side=which.side, preset=which.preset)
    given = tyro.cli(
        _Arguments,
        prog="posse train",
        description="Train a team, or a target. The same command again resumes a run, perhaps for more --steps.",
        default=_Arguments.from_dict({**default.to_dict(), "preset": which.preset}),
        args=arguments,
    )
    given = replace(given, reward_weights={**default.reward_weights, **given.reward_weights})
    check_read(given, default)
    require("training", "torch", "stable_baselines3")
    paths = train_all(given.runs, given.ray)
    print("\n".join(map(str, paths)) if len(given.seeds) > 1 else _what_next(paths[0]))


def train_all(runs: Sequence[TrainSettings], ray: bool | str) -> list[Path]:
    """Train every run, or resume it where its folder holds it; return the best policies' files.

    On a Ray cluster each run is one task, which writes to its run folder on a file system that all nodes share: a run
    whose worker died is resumed from its checkpoint by another one.
    """
    from posse_training.train.train import check_before, train  # torch

    for settings in runs:
        check_before(settings)
        check_held(settings.run_folder / SETTINGS, settings.held(), FREE)
    if ray is not False:
        with connected(ray, log=True):
            return all_on_ray(train_on_worker, [(settings, Path.cwd()) for settings in runs])
    paths, failed = [], []
    for settings in runs:
        try:
            paths.append(train(settings))
        except RunFolderError as error:  # such as networks that diverge: other seeds are trained nevertheless
            failed.append(f"seed {settings.seed}: {error}")
            if settings is not runs[-1]:  # whose error is shown in any case
                print(failed[-1], file=sys.stderr)
    if failed:
        made = "".join(f"\nmade: {path}" for path in paths)
        raise RunFolderError("\n".join(failed) + made)
    return paths


def train_on_worker(settings: TrainSettings, where: Path) -> Path:
    """Train on a worker as in the folder ``where``, on one thread; return the best policy's file."""
    from posse_training.train.train import train  # torch

    if not where.is_dir():
        raise ClusterError(f"node {platform.node()} has no folder {where}: train on a file system that all nodes share")
    with contextlib.chdir(where):
        console = Console(width=100)
        console.print(f"seed {settings.seed}: {settings.run_folder}", markup=False)
        return train(settings, console=console, num_threads=1)


def _what_next(path: Path) -> str:
    """Return the file of the policy, and the commands that show what it does."""
    run = read_settings(path.with_name(SETTINGS))
    scenario, _, _ = run.scenario.partition(",")
    beside, policy = shlex.quote(run.beside or "ddcs-tuned"), shlex.quote(str(path))
    page = shlex.quote(str(path.with_name("replay.html")))
    opponents = [shlex.quote(name) for name in run.opponents]
    watched, teams, target = policy, f"{beside} {policy}", ""
    if run.side == "target":
        watched, teams, target = opponents[0], " ".join(opponents), f" --target {policy}"
    elif opponents:
        target = f" --target {opponents[-1]}"
    size = {"num_trackers": run.team_sizes[0]} if run.team_sizes else {}
    settings = words_of({**run.overrides, **size})
    changed = f" --set {shlex.join(settings)}" if settings else ""
    where = f"--scenario {scenario}{target}{changed}{''.join(f' --import {module}' for module in users_modules())}"
    lines = [f"watch {watched} {where}", f"compare {teams} {where}", f"replay {teams} {where} --out {page}"]
    shown = lines[1:2] if scenario in family_names() else lines  # watch and replay show one scenario
    return "\n".join([f"{path}\nnext:", *(f"  posse {line}" for line in shown)])
