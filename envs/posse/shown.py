"""Values as error messages show them."""

from __future__ import annotations

from typing import Final

LONGEST: Final = 120
"""Characters of a value that a message shows."""


def shown(value: object) -> str:
    """Return what ``repr`` says of a value, in at most about 150 characters; never raises."""
    try:
        text = repr(value)
    except Exception:  # repr may raise anything; it also fails for an int of 10,000 digits
        return f"<{type(value).__name__} that is too long to show, or cannot be>"
    if len(text) <= LONGEST:
        return text
    half = LONGEST // 2
    return f"{text[:half]}...{text[-half // 4 :]} ({len(text):,} characters)"
