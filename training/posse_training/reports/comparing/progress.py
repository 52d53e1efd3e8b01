"""Progress of a comparison: one bar for everything that is played, with the time left."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Final

from rich.console import Console, Group, RenderableType
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from posse_training.live_display import LiveDisplay, clock

_EXPECTED: Final = {"planner": 0.4}
"""Seconds per world of policies that are far slower than others, until they have played."""
_USUAL: Final = 0.004
_LINE_EVERY: Final = 20.0  # s, without a terminal
_WIDTH: Final = 40


class Progress(LiveDisplay):
    """One bar for all evaluations of a comparison; without a terminal, a line now and then.

    The time left is that of the worlds left, at the latest pace of each policy: a world takes the
    planner a hundred times as long as others.

    Args:
        evaluations: Number of evaluations of each policy.
        worlds: Number of worlds of each policy, in all evaluations.
        console: Where to show it.
        now: Returns the time in seconds.
    """

    def __init__(
        self,
        evaluations: Mapping[str, int],
        worlds: Mapping[str, int],
        console: Console,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(console, transient=True)
        self._now = now
        self._left = dict(worlds)
        self._pace: dict[str, float] = {}
        self._all = sum(evaluations.values())
        self._done = 0
        self._started = self._shown = self._since = now()
        self._label: str | None = None
        self._worlds = self._steps = self._of = 0

    def begin(self, label: str, what: str, worlds: int, steps: int) -> None:
        """Start an evaluation of a policy, which will take a number of steps in all."""
        self._label, self._worlds, self._steps, self._of = label, worlds, 0, steps
        self._since = self._now()
        self._note = f"{label} on {what}"

    def advance(self, steps: int) -> None:
        """Count control steps of the present evaluation."""
        if self._steps == 0:
            self._since = self._now()  # what is compiled before the first step is not repeated
        self._steps += steps

    def end(self) -> None:
        """Finish the present evaluation, whether or not it was played to its end."""
        label, now = self._label, self._now()
        assert label is not None
        if self._steps >= self._of:
            self._pace[label] = (now - self._since) / max(self._worlds, 1)
        self._left[label] -= self._worlds
        self._done += 1
        self._label = None
        if self._live is None and now - self._shown >= _LINE_EVERY:
            self._shown = now
            self._console.print(f"{self._summary}: {self._note}", markup=False, soft_wrap=True)

    @property
    def time_left(self) -> float:
        """Seconds until everything is played."""
        left = sum(worlds * self._expected(label) for label, worlds in self._left.items())
        if self._label is None:
            return left
        whole = self._worlds * self._expected(self._label)
        return max(0.0, left - min(self._now() - self._since, whole))

    def _expected(self, label: str) -> float:
        """Return the seconds per world of a policy: its latest, or a guess."""
        if label == self._label and self._steps > 0.1 * self._of:
            spent, share = self._now() - self._since, self._steps / self._of
            return spent / share / max(self._worlds, 1)
        if label in self._pace:
            return self._pace[label]
        if label in _EXPECTED:
            return _EXPECTED[label]
        usual = [pace for name, pace in self._pace.items() if name not in _EXPECTED]
        return sum(usual) / len(usual) if usual else _USUAL

    @property
    def _summary(self) -> str:
        return f"{self._done} of {self._all} evaluations, about {clock(self.time_left)} left"

    def _render(self) -> RenderableType:
        spent, left = self._now() - self._started, self.time_left
        row = Table.grid(padding=(0, 1))
        bar = ProgressBar(total=max(spent + left, 1e-9), completed=spent, width=_WIDTH)
        row.add_row(bar, Text(self._summary))
        return Group(row, Text(self._note, overflow="fold"))
