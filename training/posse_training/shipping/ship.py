"""``posse ship``: the best of several training runs becomes a policy of the package.

The runs, which differ in their training seeds, are compared on validation worlds that none of them
was evaluated on. The card of the shipped policy has the score of every seed, and a *check*: scores
on a few fixed worlds that an installed policy must reproduce.
"""

from __future__ import annotations

import csv
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import tyro
from rich.console import Console

from posse_baselines.learned import LearnedPolicy
from posse_baselines.registry import LEARNED, SHIPPED
from posse_training.errors import SettingsError
from posse_training.reports.evaluation import evaluate
from posse_training.reports.results import Column
from posse_training.reports.statistics import mean
from posse_training.runs.saved.command import command_of
from posse_training.runs.settings import TrainSettings, read_settings
from posse_training.shipping.check import SPLIT, make_check

CHOICE_SEED: Final = 1  # seed 0 is evaluated during training
LARGEST: Final = 1_000_000
"""Largest size of a shipped file, bytes."""

_JUDGED: Final = ("safe_score", "score", "contact_free")
"""The first one decides; the others are stated beside it."""
_MAY_DIFFER: Final = {
    "seed",
    "folder",
    "steps",
    "evaluate_every",
    "evaluate_worlds",
    "beside",
    "checkpoint_every",
    "threads",
    "tensorboard",
    "wandb",
}
"""Settings in which the compared runs may differ."""


@dataclass(frozen=True)
class Settings:
    """Arguments of ``posse ship``."""

    runs: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Run folders; the runs differ in their training seeds only."""
    name: str
    """Name of the policy: learned-..."""
    worlds: int = 200
    """Validation worlds of each scenario and team size to compare the seeds on."""
    out: Path = SHIPPED
    """Folder to write to; default: the package's own."""
    keep: Path | None = None
    """Folder in which to keep the best policy of every run too, as NAME-SEED."""


def ship(settings: Settings) -> Path:
    """Write the best policy of several runs to the package; return its file.

    Raises:
        SettingsError: A name without the prefix of learned policies, runs that differ in more than
            their seeds, or a policy that is too large.
        PolicyError: A run without a policy, or with a damaged one.
    """
    if not settings.name.startswith(LEARNED):
        raise SettingsError(f"name={settings.name!r} must begin with {LEARNED!r}")
    trained = _one_training(settings.runs)
    policies = [LearnedPolicy.from_file(run / "best.safetensors") for run in settings.runs]
    plays = [_play(policy, trained[0], settings.worlds) for policy in policies]
    # A run may end where it began, as the policy that it corrects or copies: that is none to ship.
    learned = [policy.card["steps"] > 0 for policy in policies]
    scores = [play["safe_score"].mean() for play in plays]
    best = int(np.argmax(np.where(learned if any(learned) else True, scores, -np.inf)))
    card = {
        **policies[best].card,
        "name": settings.name,
        "settings": {**trained[best].to_dict(), "folder": None},
        "command": command_of(trained[best]),
        "chosen_on": SPLIT,
        "training_seeds": [
            {
                "seed": run.seed,
                "steps": policy.card.get("steps"),
                "commit": policy.card.get("commit"),
                "command": command_of(run),
                **{name: mean(play[name]).to_dict() for name in _JUDGED},
            }
            for run, policy, play in zip(trained, policies, plays, strict=True)
        ],
        "choice": {"split": SPLIT, "seed": CHOICE_SEED, "worlds": settings.worlds},
        **{f"validation_{name}": float(plays[best][name].mean()) for name in _JUDGED},
        "curve": _curve(settings.runs[best]),
    }
    card["check"] = make_check(policies[best], trained[0].scenarios)
    path = settings.out / f"{settings.name}.safetensors"
    _save(policies[best].with_card(card), path)
    if settings.keep is not None:
        settings.keep.mkdir(parents=True, exist_ok=True)
        for run, policy in zip(trained, policies, strict=True):
            _save(policy, settings.keep / f"{settings.name}-{run.seed}.safetensors")
    return path


def _play(policy: LearnedPolicy, run: TrainSettings, worlds: int) -> dict[str, Column]:
    """Return the results of a policy over all scenarios of a run, by name."""
    results = [evaluate(policy, s, worlds, CHOICE_SEED, split=SPLIT) for s in run.scenarios]
    return {name: np.concatenate([r[name] for r in results]) for name in _JUDGED}


def _save(policy: LearnedPolicy, path: Path) -> None:
    """Write a policy unless its file is too large; an old file then stays."""
    with tempfile.TemporaryDirectory() as folder:
        trial = Path(folder, path.name)
        policy.save(trial)
        size = trial.stat().st_size
    if size > LARGEST:
        raise SettingsError(
            f"{path} would have {size:,} bytes, {LARGEST:,} are allowed: train with smaller hidden layers"
        )
    policy.save(path)


def _one_training(runs: Sequence[Path]) -> list[TrainSettings]:
    """Return the settings of runs that differ only in their seeds and in how they were logged.

    Raises:
        SettingsError: They differ in something else, or two have the same seed.
    """
    if not runs:
        raise SettingsError("No run folders given. Pass at least one.")
    trained = [read_settings(run / "settings.json") for run in runs]
    seeds = [run.seed for run in trained]
    if len(set(seeds)) < len(seeds):
        raise SettingsError(f"the runs must have different training seeds, these have {seeds}")
    first = trained[0].to_dict()
    for folder, run in zip(runs, trained, strict=True):
        differing = [
            f"{name} ({first[name]!r}, {value!r})"
            for name, value in run.to_dict().items()
            if value != first[name] and name not in _MAY_DIFFER
        ]
        if differing:
            raise SettingsError(
                f"{runs[0]} and {folder} must differ in their seeds only: they differ in {', '.join(differing)}"
            )
    return trained


def _curve(run: Path) -> list[dict[str, float]]:
    path = run / "curve.csv"
    try:
        with path.open(newline="", encoding="utf-8") as file:
            return [{name: float(v) for name, v in row.items()} for row in csv.DictReader(file)]
    except (OSError, AttributeError, TypeError, ValueError, csv.Error) as error:
        raise SettingsError(
            f"{path} is missing or damaged: {error}. Resume the run to write it again: posse train --resume {run}"
        ) from error


def main(arguments: Sequence[str] | None = None) -> None:
    """Ship a policy and print the score of every seed."""
    settings = tyro.cli(
        Settings,
        prog="posse ship",
        description="Make the best of several training runs a policy of the package.",
        args=arguments,
    )
    console = Console()
    path = ship(settings)
    policy = LearnedPolicy.from_file(path)
    for run in policy.card["training_seeds"]:
        score = run["safe_score"]
        console.print(
            f"training seed {run['seed']}: safe score {score['value']:.3f} "
            f"[{score['low']:.3f}, {score['high']:.3f}], score {run['score']['value']:.3f}, "
            f"contact-free {run['contact_free']['value']:.3f} "
            f"on {score['count']:,} validation worlds"
        )
    console.print(
        f"{path} ({path.stat().st_size:,} bytes) holds training seed {policy.card['seed']}",
        markup=False,
        soft_wrap=True,
    )
