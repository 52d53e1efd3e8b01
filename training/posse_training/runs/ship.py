"""``posse ship``: from runs of several training seeds to one policy that comes with the package.

The seeds are compared on validation worlds that no run has seen. What is shipped says in its card
how every seed did, and carries a *check*: the scores that it has to reach again on a few fixed
worlds, wherever it is installed.
"""

from __future__ import annotations

import csv
import dataclasses
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
import tyro
from rich.console import Console

from posse import Scenario, get_scenario
from posse_baselines.learned import LearnedPolicy
from posse_baselines.registry import LEARNED, SHIPPED
from posse_training.reports.evaluation import evaluate
from posse_training.reports.statistics import mean
from posse_training.runs.settings import (
    SettingsError,
    TrainSettings,
    default_settings,
    read_settings,
)

SPLIT: Final = "validation"
CHOICE_SEED: Final = 1  # runs look at seed 0 while they train
CHECK_SEED: Final = 2
CHECK_WORLDS: Final = 32
LARGEST: Final = 1_000_000
"""Bytes that a shipped file may have."""

_MAY_DIFFER: Final = {
    "seed", "folder", "steps", "evaluate_every", "evaluate_worlds", "beside", "checkpoint_every",
    "threads", "tensorboard", "wandb",
}  # fmt: skip
"""Settings that runs of one training may have of their own."""
_NOT_PLAYED: Final = {"name", "version", "reward_weights", "message_size"}
"""Fields of a scenario that change no score, or that stand for themselves in a check."""


@dataclass(frozen=True)
class Settings:
    """What ``posse ship`` takes."""

    runs: Annotated[tuple[Path, ...], tyro.conf.Positional]
    """Run folders of one training from different seeds."""
    name: str
    """What the policy is to be called: learned-..."""
    worlds: int = 200
    """Validation worlds of each scenario and team size that the seeds are compared on."""
    out: Path = SHIPPED
    """Folder to write to; default: where the package looks."""


def ship(settings: Settings) -> Path:
    """Write the best of several runs as a policy that comes with the package; return its file.

    Raises:
        SettingsError: A name that no learned policy has, runs that are not of one training, or a
            policy too large.
        PolicyError: A run without a policy, or with a damaged one.
    """
    if not settings.name.startswith(LEARNED):
        raise SettingsError(f"name={settings.name!r} must begin with {LEARNED!r}")
    trained = _one_training(settings.runs)
    policies = [LearnedPolicy.from_file(run / "best.safetensors") for run in settings.runs]
    scores = [
        np.concatenate(
            [
                evaluate(policy, scenario, settings.worlds, CHOICE_SEED, split=SPLIT)["score"]
                for scenario in trained[0].scenarios
            ]
        )
        for policy in policies
    ]
    best = int(np.argmax([score.mean() for score in scores]))
    card = {
        **policies[best].card,
        "name": settings.name,
        "settings": {**trained[best].to_dict(), "folder": None},
        "command": command_of(trained[best]),
        "chosen_on": SPLIT,
        "training_seeds": [
            {
                "seed": run.seed,
                "steps": policy.card["steps"],
                "commit": policy.card["commit"],
                "command": command_of(run),
                "score": mean(score).to_dict(),
            }
            for run, policy, score in zip(trained, policies, scores, strict=True)
        ],
        "choice": {"split": SPLIT, "seed": CHOICE_SEED, "worlds": settings.worlds},
        "validation_score": float(scores[best].mean()),
        "curve": _curve(settings.runs[best]),
    }
    card["check"] = make_check(policies[best], trained[0].scenarios)
    path = settings.out / f"{settings.name}.safetensors"
    policies[best].with_card(card).save(path)
    path.chmod(0o644)  # written for its owner alone, it would come along like that
    if path.stat().st_size > LARGEST:
        size = path.stat().st_size
        for file in (path, path.with_suffix(".json")):
            file.unlink()
        raise SettingsError(f"{path} would have {size:,} bytes, {LARGEST:,} are allowed")
    return path


def _one_training(runs: Sequence[Path]) -> list[TrainSettings]:
    """Return the settings of runs that differ in nothing but their seeds and how they were kept.

    Raises:
        SettingsError: They differ in something else, or two have one seed.
    """
    if not runs:
        raise SettingsError("nothing to ship: name at least one run folder")
    trained = [read_settings(run / "settings.json") for run in runs]
    seeds = [run.seed for run in trained]
    if len(set(seeds)) < len(seeds):
        raise SettingsError(f"runs to compare need different training seeds, these have {seeds}")
    first = trained[0].to_dict()
    for folder, run in zip(runs, trained, strict=True):
        differing = [
            f"{name} ({first[name]!r}, {value!r})"
            for name, value in run.to_dict().items()
            if value != first[name] and name not in _MAY_DIFFER
        ]
        if differing:
            raise SettingsError(
                f"{runs[0]} and {folder} are not of one training: they differ in "
                f"{', '.join(differing)}"
            )
    return trained


def command_of(settings: TrainSettings) -> str:
    """Return the command that trains with these settings, wherever its folder was.

    What a scenario's own defaults say is stated, too: they are often written down only after the
    training that found them, so that at the commit of the training there were none.
    """
    default = default_settings(settings.scenario, settings.algorithm).to_dict()
    of_all = default_settings(settings.scenario, settings.algorithm, own=False).to_dict()
    stated = ("scenario", "algorithm", "steps", "seed")
    words = ["posse", "train"]
    for name, value in settings.to_dict().items():
        usual = value == default[name] == of_all[name]
        if name == "folder" or (usual and name not in stated):
            continue
        option = name.replace("_", "-")
        if isinstance(value, bool):
            words.append(f"--{option}" if value else f"--no-{option}")
        elif isinstance(value, dict) and default[name]:
            words += [w for k, v in value.items() for w in (f"--{option}.{k}", str(v))]
        elif isinstance(value, dict):
            words += [f"--{option}", *(str(part) for item in value.items() for part in item)]
        elif isinstance(value, (tuple, list)):
            words += [f"--{option}", *map(str, value)]
        else:
            words += [f"--{option}", str(value)]
    return shlex.join(words)


def _curve(run: Path) -> list[dict[str, float]]:
    with (run / "curve.csv").open(newline="", encoding="utf-8") as file:
        return [{name: float(v) for name, v in row.items()} for row in csv.DictReader(file)]


# --- the check -----------------------------------------------------------------------------------


def make_check(policy: LearnedPolicy, scenarios: Sequence[Scenario]) -> dict[str, Any]:
    """Return the scores that a policy has on a few fixed worlds of each scenario."""
    check: dict[str, Any] = {
        "split": SPLIT,
        "seed": CHECK_SEED,
        "worlds": max(4, CHECK_WORLDS // len(scenarios)),
        "plays": [
            {"scenario": s.name, "version": s.version, "settings": _settings_of(s)}
            for s in scenarios
        ],
    }
    for play, score in zip(check["plays"], replay(policy, check), strict=True):
        play["score"] = score
    return check


def replay(policy: LearnedPolicy, check: Mapping[str, Any]) -> list[float]:
    """Return the scores that a policy has now on the worlds of its check."""
    return [
        float(
            evaluate(
                policy, scenario, check["worlds"], check["seed"], split=check["split"],
                progress=False,
            )["score"].mean()
        )
        for scenario in check_scenarios(check)
    ]  # fmt: skip


def check_scenarios(check: Mapping[str, Any]) -> list[Scenario]:
    """Return the scenarios that a check plays, as they are now."""
    return [
        get_scenario(
            play["scenario"],
            **{k: tuple(v) if isinstance(v, list) else v for k, v in play["settings"].items()},
        )
        for play in check["plays"]
    ]


def _settings_of(scenario: Scenario) -> dict[str, Any]:
    """Return what a scenario has other than the one whose name it bears."""
    named = get_scenario(scenario.name)
    return {
        field.name: getattr(scenario, field.name)
        for field in dataclasses.fields(scenario)
        if field.name not in _NOT_PLAYED
        and getattr(scenario, field.name) != getattr(named, field.name)
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Ship a policy and say how the seeds did."""
    settings = tyro.cli(
        Settings,
        prog="posse ship",
        description="Make the best of several runs a policy that comes with the package.",
        args=arguments,
    )
    console = Console()
    path = ship(settings)
    policy = LearnedPolicy.from_file(path)
    for run in policy.card["training_seeds"]:
        score = run["score"]
        console.print(
            f"training seed {run['seed']}: {score['value']:.3f} "
            f"[{score['low']:.3f}, {score['high']:.3f}] on {score['count']:,} validation worlds"
        )
    console.print(
        f"{path} ({path.stat().st_size:,} bytes) holds training seed {policy.card['seed']}"
    )
