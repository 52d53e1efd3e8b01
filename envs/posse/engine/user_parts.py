"""Compile errors in functions that users' modules declare, reported by function and line."""

from __future__ import annotations

import contextlib
import difflib
import dis
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

from numba.core import types
from numba.core.errors import NumbaError

from posse.numeric.lane_code import LanesType
from posse.rules.state import CONFIG, TRACKER, WorldArrays
from posse.signals.observation.views import Mate, View
from posse.signals.parts import Parts, added

_NOISE: Final = re.compile(r"\x1b\[[0-9;]*m|Failed in nopython mode.*\n")
_LONGEST: Final = 200
_ARTICLES: Final = {"nothing": "nothing", "number": "a number", "pair": "a pair", "truth": "a truth"}


@contextlib.contextmanager
def mistakes_named(parts: Parts, worlds: WorldArrays) -> Iterator[None]:
    """Report an error of the compiler in a user's function.

    Raises:
        DeclarationError: Names the function, the line and the reason.
    """
    try:
        yield
    except (NumbaError, KeyError) as error:  # KeyError: a field that a record lacks
        names = {*(CONFIG.names or ()), *(worlds.world.dtype.names or ()), *(TRACKER.names or ())}
        for registry, thing in added(parts):
            for function, returns in thing.functions:
                reason = _mistake(error, function, returns, names.union(View._fields, Mate._fields))
                if reason is not None:
                    raise registry.error(function, reason) from error
        raise


def _mistake(error: Exception, function: Callable[..., Any], returns: str, names: set[str]) -> str | None:
    """Return the line and the reason if the error is in this function."""
    code = getattr(function, "py_func", function).__code__
    text = _NOISE.sub("", str(error))
    fields = error.args if isinstance(error, KeyError) else re.findall(r"Unknown attribute '(\w+)'", text)
    for step in dis.get_instructions(code):
        if "ATTR" in step.opname and step.argval in fields and step.positions is not None:
            near = difflib.get_close_matches(step.argval, names, n=3)
            hint = f" (did you mean {' or '.join(near)}?)" if near else ""
            return f"line {step.positions.lineno}: unknown field {step.argval!r}{hint}"
    for found in _returned(function):
        if not _fits(found, returns):
            return f"line {code.co_firstlineno}: it returns {_short(str(found))}, not {_ARTICLES.get(returns, returns)}"
    file, last = re.escape(Path(code.co_filename).name), max(line or 0 for *_, line in code.co_lines())
    lines = [int(line) for line in re.findall(rf'{file}(?:" *, line | \()(\d+)', text)]
    inside = [line for line in lines if code.co_firstlineno <= line <= last]
    return f"line {inside[-1]}: {_short(text.strip().splitlines()[0])}" if inside else None


def _returned(function: Any) -> list[Any]:
    """Return the types that compiled forms of a function return."""
    inner = getattr(function, "inner", {}).values()
    return [form.signature.return_type for each in inner for form in each.overloads.values()]


def _fits(found: Any, returns: str) -> bool:
    parts = [*found] if "Tuple" in type(found).__name__ else []
    numbers = all(isinstance(each, types.Number | types.Boolean | LanesType) for each in parts or [found])
    if returns == "nothing":
        return isinstance(found, types.NoneType)
    if returns == "pair":
        return len(parts) == 2
    return numbers and len(parts) == (int(returns.split()[0]) if returns[0].isdigit() else 0)


def _short(text: str) -> str:
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"
