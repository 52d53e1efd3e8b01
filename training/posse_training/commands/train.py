"""``posse train``: train a team, once or with several seeds."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated

import tyro

from posse_training.errors import require
from posse_training.options import Names, Ray
from posse_training.train.presets import Preset, default_settings
from posse_training.train.settings import SETTINGS, TrainSettings, read_settings


@dataclass(frozen=True)
class _Which:
    """What the defaults of all other settings depend on."""

    scenario: Names = "smart"
    algorithm: str = "ppo"
    side: str = "trackers"
    preset: Preset = "nothing"


@dataclass(frozen=True, kw_only=True)
class _Arguments(TrainSettings):
    """Settings of a training, and how often and where it is made."""

    preset: Preset = "nothing"
    """Default settings: learn from nothing, that is from random weights; or, on policy, a correction of a scripted
    team."""
    seed: Annotated[int, tyro.conf.Suppress] = 1
    seeds: Annotated[tuple[int, ...], tyro.conf.arg(name="seed")] = (1,)
    """Seed of the worlds, the networks and the exploration; or several for as many runs, in turn, or with --ray at
    once, which the same command resumes."""
    ray: Ray = False
    """Make them on a Ray cluster."""

    @property
    def settings(self) -> TrainSettings:
        """The settings alone."""
        values = {field.name: getattr(self, field.name) for field in fields(TrainSettings)}
        return TrainSettings(**{**values, "seed": self.seeds[0]})


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
    require("training", "torch", "stable_baselines3")
    from posse_training.train.seeds import train_seeds, with_seeds

    try:
        paths = list(train_seeds(with_seeds(given.settings, given.seeds), given.ray))
    except KeyboardInterrupt:
        print("\nto resume: run the same command again", file=sys.stderr)
        raise
    print("\n".join(map(str, paths)) if len(given.seeds) > 1 else _what_next(paths[0]))


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
    return (
        f"{path}\nnext:\n"
        f"  posse watch {watched} --scenario {scenario}{target}\n"
        f"  posse compare {teams} --scenario {scenario}{target}\n"
        f"  posse replay {teams} --scenario {scenario}{target} --out {page}"
    )
