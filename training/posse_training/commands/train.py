"""``posse train``: train a team, or resume a training run."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import tyro

from posse_training.errors import require
from posse_training.files import read_json
from posse_training.parallel import RayOption, address_of
from posse_training.runs.defaults import default_settings
from posse_training.runs.settings import TrainSettings, opponents_of

_NEEDED = ("training", "torch", "stable_baselines3")


@dataclass(frozen=True)
class _Which:
    """The settings that the defaults of all others depend on."""

    scenario: str = "smart"
    algorithm: str = "ppo"
    side: str = "trackers"


@dataclass(frozen=True)
class _Seeds:
    """Several runs."""

    seeds: tuple[int, ...] = ()
    """Seeds of the runs."""
    ray: RayOption = None
    """Where they are made."""


@dataclass(frozen=True)
class _Resume:
    """Resume a training run."""

    resume: Path
    """Run folder."""
    steps: int | None = None
    """Total steps to train for; default: as the run was started with."""
    trust_code: bool = False
    """Import policies that the folder's settings.json names as package.module:Class."""


def main(arguments: Sequence[str]) -> None:
    """Train a team, once or with several seeds, or resume: ``posse train --resume DIR``."""
    if any(a == "--resume" or a.startswith("--resume=") for a in arguments):
        which = tyro.cli(_Resume, prog="posse train", args=arguments)
        require(*_NEEDED)
        from posse_training.runs.train import resume

        with _how_to_resume(which.resume):
            path = resume(which.resume, steps=which.steps, trust_code=which.trust_code)
        print(_what_next(path))
        return
    asked = [a for a in arguments if a not in ("-h", "--help")]
    some, _ = tyro.cli(_Which, args=asked, return_unknown_args=True)
    several, rest = tyro.cli(_Seeds, args=asked, return_unknown_args=True)
    if several.seeds or several.ray is not None:
        arguments = [*rest, *(a for a in arguments if a in ("-h", "--help"))]
    settings = tyro.cli(
        TrainSettings,
        prog="posse train",
        description="Train a team. To resume a run: posse train --resume DIR. Several seeds: "
        "--seeds 1 2 3 ..., in turn, or with --ray [ADDRESS] at once on a Ray cluster; the same "
        "command again resumes them.",
        default=default_settings(some.scenario, some.algorithm, side=some.side),
        args=arguments,
    )
    require(*_NEEDED)
    if several.seeds or several.ray is not None:
        _train_all(settings, several)
        return
    from posse_training.runs.train import train

    with _how_to_resume(settings.run_folder):
        path = train(settings)
    print(_what_next(path))


def _what_next(path: Path) -> str:
    """Return the file of the policy, and the commands that show what it does."""
    run = read_json(path.parent / "settings.json")
    scenario, _, _ = run["scenario"].partition(",")
    beside, policy = shlex.quote(run["beside"] or "ddcs-tuned"), shlex.quote(str(path))
    page = shlex.quote(str(path.with_name("replay.html")))
    opponents = [shlex.quote(name) for name in opponents_of(run["against"])]
    watched, teams, target = policy, f"{beside} {policy}", ""
    if run["side"] == "target":
        watched, teams, target = opponents[0], " ".join(opponents), f" --target {policy}"
    elif opponents:
        target = f" --target {opponents[-1]}"
    return (
        f"{path}\nnext:\n"
        f"  posse watch {watched} --scenario {scenario}{target}\n"
        f"  posse compare {teams} --scenarios {scenario}{target}\n"
        f"  posse replay {teams} --scenario {scenario}{target} --out {page}"
    )


def _train_all(settings: TrainSettings, several: _Seeds) -> None:
    """Train with every seed, and print the files of the best policies."""
    from posse_training.runs.seeds.in_turn import train_seeds, with_seeds

    ray = address_of(several.ray)
    runs = with_seeds(settings, several.seeds or (settings.seed,))
    try:
        for path in train_seeds(runs, ray):
            print(path)
    except KeyboardInterrupt:
        print("\nto resume: run the same command again", file=sys.stderr)
        raise


@contextmanager
def _how_to_resume(folder: Path) -> Iterator[None]:
    """Print how to resume a run that the user interrupts."""
    try:
        yield
    except KeyboardInterrupt:
        print(f"\nto resume: posse train --resume {folder}", file=sys.stderr)
        raise
