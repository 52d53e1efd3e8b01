"""Values and names as error messages show them."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Final

LONGEST: Final = 120
"""Characters of a value that a message shows."""


def shown(value: object) -> str:
    """Return what ``repr`` says of a value, in at most about 150 characters; never raises."""
    try:
        text = repr(value)
    except Exception:  # repr may raise anything; it also fails for an int of 10,000 digits
        return f"<{type(value).__name__} without a text>"
    if len(text) <= LONGEST:
        return text
    half = LONGEST // 2
    return f"{text[:half]}...{text[-half // 4 :]} ({len(text):,} characters)"


def unknown(kind: str, name: object, known: Iterable[str]) -> str:
    """Return the message for a name that is none of the known ones, with those most like it."""
    names = tuple(known)
    text = name if isinstance(name, str) else shown(name)
    near = difflib.get_close_matches(text[:LONGEST], names, n=3, cutoff=0.5)
    hint = f" (did you mean {' or '.join(map(repr, near))}?)" if near else ""
    return f"unknown {kind} {shown(name)}{hint}; known: {', '.join(names) or 'none'}"
