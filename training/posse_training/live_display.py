"""A live display on a terminal, and lines elsewhere."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Self

from rich.console import Console, RenderableType
from rich.live import Live


class LiveDisplay(ABC):
    """Shows what :meth:`_render` returns while the context is open, if there is a terminal.

    Args:
        console: Where to show it.
        transient: Whether to remove it at the end.
    """

    def __init__(self, console: Console, *, transient: bool = False) -> None:
        self._console = console
        self._transient = transient
        self._note = ""
        self._live: Live | None = None

    def __enter__(self) -> Self:
        if self._console.is_terminal:
            self._live = Live(
                get_renderable=self._render, console=self._console, refresh_per_second=4, transient=self._transient
            )
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._live is not None:
            self._live.stop()

    def note(self, text: str) -> None:
        """Show what the run is doing."""
        self._note = text
        if self._live is None:
            self._console.print(text, markup=False, soft_wrap=True)

    @abstractmethod
    def _render(self) -> RenderableType:
        """Return the display of the present state."""


def clock(seconds: float) -> str:
    """Return a duration as hours, minutes and seconds."""
    if seconds == float("inf"):
        return "unknown time"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
