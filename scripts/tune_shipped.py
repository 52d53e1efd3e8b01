"""``make tune``: repeat every tuning run whose result ships, by the command on its card; interrupted, it resumes."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import tyro
from rich.console import Console

from posse_baselines.tuned import TUNED, tuned_files
from posse_training.tune import TuneSettings, tune


def repeat_all(folder: Path, console: Console) -> Iterator[Path]:
    """Repeat the runs of all shipped files in run folders below one, and write these again; yield the results."""
    for name in TUNED:
        for path in tuned_files(name).values():
            words = shlex.split(json.loads(path.read_text(encoding="utf-8"))["command"])
            settings = tyro.cli(TuneSettings, args=words[2:])
            out = folder / f"{settings.policy}-{settings.scenario}-{settings.seed}"
            yield tune(replace(settings, out=out, ship=True), console=console)


if __name__ == "__main__":
    for result in repeat_all(Path("runs/tune/shipped"), Console()):
        print(result)
