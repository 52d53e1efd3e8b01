"""Progress of a tuning run: a live display, or lines where there is no terminal."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Final

from rich.console import Console, Group, RenderableType
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from posse_baselines import Tunable
from posse_training.live_display import LiveDisplay
from posse_training.sparkline import sparkline
from posse_training.tuning.settings import TuneSettings
from posse_training.tuning.state import State

_WIDTH: Final = 40
_SHOWN: Final = 8  # settings


class Display(LiveDisplay):
    """Shows progress, scores, and the settings that changed most.

    Args:
        settings: Of the run.
        console: Where to show it.
    """

    def __init__(self, settings: TuneSettings, console: Console) -> None:
        super().__init__(console)
        self._settings = settings
        self._started = time.monotonic()
        self._episodes = 0
        self._candidate = 0
        self._spent = 0.0  # seconds, before this process began
        self._tunables: dict[str, Tunable] = {}
        self._state: State | None = None

    def begin(self, state: State, tunables: Sequence[Tunable]) -> None:
        """Show the state that the run begins with, or resumes from, and what is searched."""
        self._state, self._note = state, ""
        self._tunables = {t.name: t for t in tunables}
        self._spent = state.seconds
        self._started = time.monotonic()
        if self._live is None:
            names = ", ".join(state.names)
            self._console.print(f"searching {len(state.names)} settings: {names}", markup=False)
            if state.generations:
                self._console.print(f"resuming after generation {len(state.generations)}")

    def played(self, episodes: int) -> None:
        """Count episodes."""
        self._episodes += episodes

    def candidate(self, count: int) -> None:
        """Show how many candidates of the generation have been scored."""
        self._candidate = count

    def generation(self, state: State) -> None:
        """Show a generation."""
        self._candidate = 0

    def validated(self, state: State) -> None:
        """Show a score on validation worlds."""
        if self._live is None:
            point, first = state.curve[-1], state.curve[0]
            self._console.print(
                f"generation {point['generation']:>4}  safe score {point['score']:.3f} "
                f"[{point['low']:.3f}, {point['high']:.3f}]  (untuned {first['score']:.3f})  "
                f"{self._rate:,.0f} episodes/s",
                markup=False,
            )

    @property
    def _rate(self) -> float:
        elapsed = time.monotonic() - self._started
        return self._episodes / elapsed if elapsed > 0 else 0.0

    def _share_done(self, state: State) -> float:
        s, within = self._settings, self._candidate / self._settings.population
        if s.generations is not None:
            return min(1.0, (len(state.generations) + within) / s.generations)
        spent = self._spent + time.monotonic() - self._started
        return min(1.0, spent / (60.0 * s.minutes))

    def _most_changed(self, values: dict[str, float]) -> list[tuple[str, float]]:
        """Return the settings that changed most, as shares of their ranges."""

        def change(item: tuple[str, float]) -> float:
            t = self._tunables[item[0]]
            return abs(item[1] - t.default) / (t.high - t.low)

        return sorted(values.items(), key=change, reverse=True)[:_SHOWN]

    def _render(self) -> RenderableType:
        s, state = self._settings, self._state
        table = Table.grid(padding=(0, 2))
        table.add_column(style="bold")
        table.add_column()
        if state is not None:
            done = self._share_done(state)
            table.add_row(
                "generation",
                f"{len(state.generations) + 1}, candidate {self._candidate} of {s.population}   "
                f"{self._rate:,.0f} episodes per second",
            )
            table.add_row("", ProgressBar(total=1.0, completed=done, width=_WIDTH))
            if state.generations:
                scores = state.generations[-1]["scores"]
                table.add_row("training score", f"{max(scores):.3f} best, {min(scores):.3f} worst candidate")
        if state is not None and state.curve:
            last, best = state.curve[-1], max(p["score"] for p in state.curve)
            table.add_row(
                "validation score", f"{last['score']:.3f} [{last['low']:.3f}, {last['high']:.3f}]   best {best:.3f}"
            )
            untuned = state.curve[0]["score"]
            for row in sparkline([p["score"] for p in state.curve], untuned, width=_WIDTH):
                table.add_row("", Text(row, style="cyan", no_wrap=True))
            table.add_row("╌╌╌╌", f"untuned {untuned:.3f}")
            for name, value in self._most_changed(last["settings"]):
                t = self._tunables[name]
                unit = f" {t.unit}" if t.unit else ""
                table.add_row(Text(name, style="dim"), f"{value:.3g}{unit} (was {t.default:.3g})")
        if self._note:
            table.add_row("", Text(self._note))
        title = Text(f"tuning {s.policy} on {s.scenario}, seed {s.seed}", overflow="fold")
        return Panel(Group(title, table), expand=False)
