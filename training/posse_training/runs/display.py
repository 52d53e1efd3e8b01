"""Progress of a training run: a live display, or lines where there is no terminal."""

from __future__ import annotations

import time
from typing import Final

from rich.console import Console, Group, RenderableType
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from posse_training.live_display import LiveDisplay, clock
from posse_training.runs.saved.curve import Point
from posse_training.runs.settings import TrainSettings
from posse_training.sb3.contact_bound import ContactBound
from posse_training.sparkline import sparkline

_WIDTH: Final = 40


class Display(LiveDisplay):
    """Shows progress, time left, and scores on the validation worlds.

    Args:
        settings: Of the run.
        console: Where to show it.
    """

    def __init__(self, settings: TrainSettings, console: Console) -> None:
        super().__init__(console)
        self._settings = settings
        self._started = time.monotonic()
        self._from_steps = 0
        self._steps = 0
        self._total = settings.steps
        self._copied: tuple[int, float | None] | None = None
        self._training_score: float | None = None
        self._bound: ContactBound | None = None
        self._curve: list[Point] = []
        self._beside: float | None = None

    def copying(self, done: int, error: float | None = None) -> None:
        """Show the rounds of imitation that are done, and the mean squared error of the last."""
        self._copied = (done, error)
        if self._live is None:
            self._console.print(self._copy_text(), markup=False)

    def _copy_text(self) -> str:
        s = self._settings
        done, error = self._copied or (0, None)
        said = "" if error is None else f", squared error {error:.4f}"
        return f"copying {s.imitate}: {done} of {s.imitate_rounds} rounds{said}"

    def begin(self, steps: int, total: int, curve: list[Point]) -> None:
        """Start the clock: training begins, or resumes after ``steps`` of ``total`` steps.

        The total includes the rollout that is completed at the end.
        """
        self._copied = None
        self._total = total
        self._started = time.monotonic()
        self._from_steps = self._steps = steps
        self._curve = list(curve)
        self._note = ""

    def beside(self, score: float | None) -> None:
        """Show the safe score of ``settings.beside`` on the same worlds."""
        self._beside = score

    def progress(self, steps: int, training_score: float | None, bound: ContactBound | None = None) -> None:
        """Show the steps made, the mean score of the latest training episodes, and contacts."""
        self._steps = steps
        self._training_score = training_score
        self._bound = bound

    def evaluated(self, point: Point) -> None:
        """Show results on validation worlds, after as many steps as they say."""
        self._curve.append(point)
        self._steps = max(self._steps, int(point["steps"]))
        if self._live is None:
            self._console.print(self._line(point), markup=False, soft_wrap=True)

    def _line(self, point: Point) -> str:
        line = (
            f"{int(point['steps']):>12,} steps  safe score {point['safe_score']:.3f} "
            f"[{point['low']:.3f}, {point['high']:.3f}]  score {point['score']:.3f}  "
            f"contact-free {point['contact_free']:.2f}"
        )
        if self._beside is not None:
            line += f"  ({self._settings.beside} {self._beside:.3f})"
        if self._bound is not None and self._bound.share is not None:
            line += f"  {_bound_text(self._bound)}"
        rate = self.rate
        return line + (f"  {rate:,.0f} steps/s, {clock(self.time_left)} left" if rate else "")

    @property
    def rate(self) -> float:
        """Steps per second since the clock was started."""
        elapsed = time.monotonic() - self._started
        return (self._steps - self._from_steps) / elapsed if elapsed > 0 else 0.0

    @property
    def time_left(self) -> float:
        """Seconds until all steps are done, at the present rate."""
        left = max(0, self._total - self._steps)
        return left / self.rate if self.rate else float("inf")

    def _render(self) -> RenderableType:
        s = self._settings
        table = Table.grid(padding=(0, 2))
        table.add_column(style="bold")
        table.add_column()
        if self._copied is not None:
            rounds = ProgressBar(total=s.imitate_rounds, completed=self._copied[0], width=_WIDTH)
            table.add_row("before", Text(self._copy_text(), overflow="fold"))
            table.add_row("", rounds)
        pace = f"   {self.rate:,.0f} per second   {clock(self.time_left)} left" if self.rate else ""
        table.add_row("steps", f"{self._steps:,} of {self._total:,}{pace}")
        table.add_row("", ProgressBar(total=self._total, completed=self._steps, width=_WIDTH))
        if self._training_score is not None:
            table.add_row("training score", f"{self._training_score:.3f}")
        if self._bound is not None and self._bound.share is not None:
            table.add_row("training", _bound_text(self._bound))
        if self._curve:
            last, best = self._curve[-1], max(p["safe_score"] for p in self._curve)
            table.add_row(
                "safe score",
                f"{last['safe_score']:.3f} [{last['low']:.3f}, {last['high']:.3f}]   "
                f"best {best:.3f}   on validation worlds",
            )
            table.add_row("score", f"{last['score']:.3f}   contact-free {last['contact_free']:.2f}")
            scores = [p["safe_score"] for p in self._curve]
            for row in sparkline(scores, self._beside, width=_WIDTH):
                table.add_row("", Text(row, style="cyan", no_wrap=True))
        if s.beside is not None and self._beside is not None:
            table.add_row("╌╌╌╌", Text(f"{s.beside} {self._beside:.3f}", overflow="fold"))
        if self._note:
            table.add_row("", Text(self._note, overflow="fold"))
        title = Text(f"{s.algorithm} on {s.scenario}, seed {s.seed}", overflow="fold")
        return Panel(Group(title, table), expand=False)


def _bound_text(bound: ContactBound) -> str:
    return (
        f"contact in {bound.share or 0.0:.1%} of episodes (bound {bound.bound:.1%}, multiplier {bound.multiplier:.2f})"
    )
