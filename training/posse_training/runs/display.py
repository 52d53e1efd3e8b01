"""Progress of a training run: a live display, or lines where there is no terminal."""

from __future__ import annotations

import time
from typing import Final

from rich.console import Console, Group, RenderableType
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from posse_training.live_display import LiveDisplay
from posse_training.runs.curve import Point
from posse_training.runs.settings import TrainSettings
from posse_training.sb3.contact_bound import ContactBound

_BARS: Final = "▁▂▃▄▅▆▇█"
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
        self._training_score: float | None = None
        self._bound: ContactBound | None = None
        self._curve: list[Point] = []
        self._beside: float | None = None

    def begin(self, steps: int, curve: list[Point]) -> None:
        """Start the clock: training begins, or resumes after ``steps`` steps."""
        self._started = time.monotonic()
        self._from_steps = self._steps = steps
        self._curve = list(curve)
        self._note = ""

    def beside(self, score: float | None) -> None:
        """Show the safe score of ``settings.beside`` on the same worlds."""
        self._beside = score

    def progress(
        self, steps: int, training_score: float | None, bound: ContactBound | None = None
    ) -> None:
        """Show the steps made, the mean score of the latest training episodes, and contacts."""
        self._steps = steps
        self._training_score = training_score
        self._bound = bound

    def evaluated(self, point: Point) -> None:
        """Show results on validation worlds."""
        self._curve.append(point)
        if self._live is None:
            self._console.print(self._line(point), markup=False)

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
        return line + (f"  {rate:,.0f} steps/s, {_clock(self.time_left)} left" if rate else "")

    @property
    def rate(self) -> float:
        """Steps per second since the clock was started."""
        elapsed = time.monotonic() - self._started
        return (self._steps - self._from_steps) / elapsed if elapsed > 0 else 0.0

    @property
    def time_left(self) -> float:
        """Seconds until all steps are done, at the present rate."""
        left = max(0, self._settings.steps - self._steps)
        return left / self.rate if self.rate else float("inf")

    def _render(self) -> RenderableType:
        s = self._settings
        table = Table.grid(padding=(0, 2))
        table.add_column(style="bold")
        table.add_column()
        table.add_row(
            "steps",
            f"{self._steps:,} of {s.steps:,}   {self.rate:,.0f} per second   "
            f"{_clock(self.time_left)} left",
        )
        table.add_row("", ProgressBar(total=s.steps, completed=self._steps, width=_WIDTH))
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
            scores = [p["safe_score"] for p in self._curve[-_WIDTH:]]
            table.add_row("", Text(sparkline(scores, self._beside), style="cyan"))
        if s.beside is not None and self._beside is not None:
            table.add_row(Text(s.beside, style="bold"), f"{self._beside:.3f}")
        if self._note:
            table.add_row("", Text(self._note))
        title = f"{s.algorithm} on {s.scenario}, seed {s.seed}"
        return Panel(Group(table), title=title, expand=False)


def sparkline(scores: list[float], beside: float | None = None) -> str:
    """Return scores as a row of bars; full height is the best score, or ``beside`` if higher."""
    top = max([*scores, beside or 0.0, 1e-9])
    return "".join(_BARS[min(7, max(0, int(8 * score / top)))] for score in scores)


def _bound_text(bound: ContactBound) -> str:
    return (
        f"contact in {bound.share or 0.0:.1%} of episodes (bound {bound.bound:.1%}, "
        f"multiplier {bound.multiplier:.2f})"
    )


def _clock(seconds: float) -> str:
    if seconds == float("inf"):
        return "unknown time"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
