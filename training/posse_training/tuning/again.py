"""Repeat every tuning run whose result ships: ``python -m posse_training.tuning.again``.

Each card states the command that made it. A run that was interrupted resumes.
"""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import tyro
from rich.console import Console

from posse_baselines.tuned import TUNED, tuned_files
from posse_training.files import read_json
from posse_training.tuning.settings import TuneSettings
from posse_training.tuning.tune import tune

_FOLDER: Final = Path("runs/tune/shipped")


def settings_of_card(card: dict[str, Any]) -> TuneSettings:
    """Return the settings of the command on a card, in a folder of its own."""
    words = shlex.split(card["command"])
    settings = tyro.cli(TuneSettings, args=words[2:])
    folder = _FOLDER / f"{settings.policy}-{settings.scenario}-{settings.seed}"
    return replace(settings, out=folder, ship=True)


def repeat_all(console: Console) -> Iterator[Path]:
    """Repeat the runs of all shipped files, and write these again; yield the results."""
    for name in TUNED:
        for path in tuned_files(name).values():
            settings = settings_of_card(read_json(path))
            console.print(f"{name} on {settings.scenario}", style="bold")
            yield tune(settings, console=console)


if __name__ == "__main__":
    shown = Console()
    for result in repeat_all(shown):
        shown.print(result)
