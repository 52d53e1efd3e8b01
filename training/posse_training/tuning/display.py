"""Progress of a tuning run: a live display, or lines where there is no terminal."""

from __future__ import annotations

import time
from types import TracebackType
from typing import Final

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from posse_training.runs.display import sparkline
from posse_training.tuning.settings import TuneSettings
from posse_training.tuning.state import State

_WIDTH: Final = 40
_SHOWN: Final = 8  # settings


class Display:
    """Shows progress, scores, and the settings that changed most.

    Args:
        settings: Of the run.
        console: Where to show it.
    """

    def __init__(self, settings: TuneSettings, console: Console) -> None:
        self._settings = settings
        self._console = console
        self._started = time.monotonic()
        self._episodes = 0
        self._candidate = 0
        self._state: State | None = None
        self._note = ""
        self._live: Live | None = None

    def __enter__(self) -> Display:
        if self._console.is_terminal:
            self._live = Live(
                get_renderable=self._render, console=self._console, refresh_per_second=4
            )
            self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._live is not None:
            self._live.stop()

    def note(self, text: str) -> None:
        """Show what the run is doing."""
        self._note = text
        if self._live is None:
            self._console.print(text, markup=False)

    def begin(self, state: State) -> None:
        """Show the state that the run begins with, or resumes from."""
        self._state, self._note = state, ""
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
        return min(1.0, (state.seconds + (time.monotonic() - self._started)) / (60.0 * s.minutes))

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
                table.add_row(
                    "training score", f"{max(scores):.3f} best, {min(scores):.3f} worst candidate"
                )
        if state is not None and state.curve:
            last, best = state.curve[-1], max(p["score"] for p in state.curve)
            table.add_row(
                "validation score",
                f"{last['score']:.3f} [{last['low']:.3f}, {last['high']:.3f}]   best {best:.3f}",
            )
            table.add_row(
                "", Text(sparkline([p["score"] for p in state.curve[-_WIDTH:]]), style="cyan")
            )
            table.add_row("untuned", f"{state.curve[0]['score']:.3f}")
            shown = list(last["settings"].items())[:_SHOWN]
            for name, value in shown:
                table.add_row(Text(name, style="dim"), f"{value:g}")
            if len(last["settings"]) > len(shown):
                table.add_row("", f"and {len(last['settings']) - len(shown)} more settings")
        if self._note:
            table.add_row("", Text(self._note))
        title = f"tuning {s.policy} on {s.scenario}, seed {s.seed}"
        return Panel(Group(table), title=Text(title), expand=False)
