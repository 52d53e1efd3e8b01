"""How the failure of a policy is told."""

from __future__ import annotations

import traceback
from pathlib import Path
from typing import Final

import posse
import posse_baselines

_OURS: Final = (
    *(str(Path(module.__file__ or "").parent) for module in (posse, posse_baselines)),
    str(Path(__file__).parents[1]),
)
_LONGEST: Final = 300  # characters of an error in a summary


class PlayError(RuntimeError):
    """A policy that raised, returned invalid actions, exceeded the time limit or crashed."""


def describe(error: BaseException) -> str:
    """Return an error in one line: its message, and where in the policy's code it was raised."""
    if isinstance(error, PlayError):
        return str(error)
    message = " ".join(str(error).split())
    if len(message) > _LONGEST:
        message = f"{message[:_LONGEST]}..."
    where = ""
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        if not frame.filename.startswith(_OURS):
            where = f" ({frame.filename}, line {frame.lineno})"
            break
    return f"{type(error).__name__}: {message}{where}"
