"""``make train-shipped``: train every team that ships.

    python -m posse_training.shipping.train_all

trains with the default settings of each scenario, one run after another: three training seeds each,
five for ``smart`` and ``field``. Finished runs are skipped, an interrupted one resumes. To use more
cores, start it several times with different ``--only``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import tyro
from rich.console import Console

from posse_baselines import PolicyError
from posse_baselines.learned import LearnedPolicy
from posse_training.errors import SettingsError
from posse_training.runs.defaults import default_settings
from posse_training.runs.saved.folder import LAST, SETTINGS
from posse_training.runs.settings import TrainSettings
from posse_training.runs.train import resume, train

ALGORITHMS: Final = {
    "smart": "ppo",
    "radio": "ppo",
    "leader-loss": "ppo",
    "obstacles": "ppo",
    "field": "mappo",
    "search": "mappo",
}
"""Scenarios with a learned team of their own, ``learned-SCENARIO``, and how it is trained."""


SEEDS: Final = {"smart": 5, "field": 5}
"""Number of training seeds, 3 for the other scenarios."""


@dataclass(frozen=True)
class Settings:
    """Arguments of ``python -m posse_training.shipping.train_all``."""

    seeds: tuple[int, ...] = ()
    """Training seeds; default: 1 to 3, for smart and field 1 to 5."""
    only: tuple[str, ...] = tuple(ALGORITHMS)
    """Scenarios to train on."""
    folder: Path = Path("runs/shipped")
    """Folder of the run folders SCENARIO-SEED."""
    list: bool = False
    """Only say what is left."""


def all_runs(settings: Settings) -> list[TrainSettings]:
    """Return the settings of all runs, the first seed of every scenario first.

    Raises:
        SettingsError: A scenario without a learned team of its own.
    """
    for name in settings.only:
        if name not in ALGORITHMS:
            raise SettingsError(
                f"only={name!r:.80} has no learned team of its own; those that have: {', '.join(ALGORITHMS)}"
            )
    return [
        replace(default_settings(name, ALGORITHMS[name]), seed=seed, folder=settings.folder / f"{name}-{seed}")
        for seed in settings.seeds or range(1, 1 + max(SEEDS.values()))
        for name in settings.only
        if settings.seeds or seed <= SEEDS.get(name, 3)
    ]


def steps_of(run: TrainSettings) -> int:
    """Return the steps of a run's last policy, 0 if it has not ended."""
    try:
        return int(LearnedPolicy.from_file(run.run_folder / LAST).card["steps"])
    except PolicyError:
        return 0


def left_of(runs: list[TrainSettings]) -> list[TrainSettings]:
    """Return the runs that are not finished."""
    return [run for run in runs if steps_of(run) < run.steps]


def train_left(settings: Settings, console: Console) -> Iterator[Path]:
    """Train what is left, in order; yield each run folder."""
    runs = all_runs(settings)
    for run in left_of(runs):
        left = left_of(runs)
        names = ", ".join(f"{r.run_folder.name} ({r.steps:,} steps)" for r in left)
        console.print(f"{len(left)} of {len(runs)} runs left: {names}", markup=False)
        if (run.run_folder / SETTINGS).is_file():
            resume(run.run_folder, console=console, steps=run.steps)
        else:
            train(run, console=console)
        yield run.run_folder


def main() -> None:
    """Train what is left, or say what it is."""
    settings = tyro.cli(Settings, prog="python -m posse_training.shipping.train_all")
    console = Console()
    if not settings.list:
        for folder in train_left(settings, console):
            console.print(f"finished: {folder}", markup=False)
    runs = all_runs(settings)
    left = left_of(runs)
    console.print(f"{len(runs) - len(left)} of {len(runs)} runs are finished")
    for run in left:
        console.print(f"left: {run.run_folder}, {run.steps:,} steps", markup=False)


if __name__ == "__main__":
    main()
