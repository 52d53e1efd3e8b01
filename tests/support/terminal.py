"""What a command shows on a terminal of 80 columns."""

from __future__ import annotations

import io

from rich.console import Console, RenderableType

WIDTH = 80


def on_a_terminal(shown: RenderableType) -> str:
    """Return what is printed; fail if a line is too long or something is cut."""
    file = io.StringIO()
    Console(width=WIDTH, file=file, color_system=None).print(shown)
    text = file.getvalue()
    assert max(map(len, text.splitlines())) <= WIDTH, text
    assert "…" not in text, text
    return text


def holds(text: str, *whole: str) -> None:
    """Fail unless every word of each text is shown, on one line or folded on several."""
    joined = "".join(text.split())
    for word in (word for each in whole for word in each.split()):
        assert word in joined, word
