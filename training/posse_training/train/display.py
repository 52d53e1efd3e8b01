"""What a training run shows: a bar on a terminal, a line for each evaluation, and logs."""

import importlib
import importlib.util
import time
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from stable_baselines3.common.logger import Logger, configure

from posse_training.train.settings import Point, TrainSettings


class Display:
    """Shows the steps made, time left, and scores on the validation worlds.

    Attributes:
        bar: To be entered while the run goes on.
        beside: Safe score of ``settings.beside`` on the same worlds, if known.
    """

    def __init__(self, settings: TrainSettings, console: Console) -> None:
        self.beside: float | None = None
        self._settings = settings
        self._started, self._from_steps = time.monotonic(), 0
        self.bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.completed:,.0f} of {task.total:,.0f} steps{task.fields[state]}"),
            TimeRemainingColumn(),
            console=console,
            transient=True,
            disable=not console.is_terminal,
        )
        self._task = self.bar.add_task(escape(settings.name), total=settings.steps, state="")

    def note(self, text: str) -> None:
        """Print what the run is doing."""
        self.bar.console.print(text, markup=False, soft_wrap=True)

    def begin(self, steps: int, total: int) -> None:
        """Start the clock: training begins, or resumes after ``steps`` of ``total`` steps."""
        if steps >= total:
            self.note(f"{steps:,} steps are made already: none is added")
        elif total != self._settings.steps:
            self.note(f"trains for {total:,} steps, which are whole rounds of its algorithm")
        self._started, self._from_steps = time.monotonic(), steps
        self.bar.reset(self._task, total=total, completed=steps)

    def progress(self, steps: int, training_score: float | None) -> None:
        """Show the steps made, and the mean score of the latest training episodes."""
        score = "" if training_score is None else f", training score {training_score:.3f}"
        self.bar.update(self._task, completed=steps, state=score)

    def evaluated(self, point: Point) -> None:
        """Print results on the validation worlds, after as many steps as they say."""
        line = (
            f"{int(point['steps']):>12,} steps  safe score {point['safe_score']:.3f} [{point['low']:.3f}, "
            f"{point['high']:.3f}], score {point['score']:.3f}, contact-free {point['contact_free']:.2f}"
        )
        if self.beside is not None:
            line += f", {self._settings.beside} {self.beside:.3f}"
        made = point["steps"] - self._from_steps
        rate = f", {made / (time.monotonic() - self._started):,.0f} steps/s" if made else ""
        self.note(line + rate)


def make_logger(folder: Path, settings: TrainSettings) -> Logger:
    """Return the logger: TensorBoard files if it is installed, which Weights & Biases copies."""
    if settings.wandb is not None:
        wandb: Any = importlib.import_module("wandb")
        wandb.init(
            project=settings.wandb,
            name=folder.name,
            dir=folder,
            config=settings.to_dict(),
            sync_tensorboard=True,
            resume="allow",
        )
    wanted = settings.tensorboard and importlib.util.find_spec("tensorboard") is not None
    return configure(str(folder), ["tensorboard"] if wanted else [])
