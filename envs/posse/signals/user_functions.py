"""Errors in functions that users' modules declare, reported by function and line."""

from __future__ import annotations

import difflib
import dis
import re
from pathlib import Path
from typing import Any, Final

import numba
import numpy as np
from numba.core import types

from posse.declarations import Declarations, Function, parameters_of, plain
from posse.numeric import UNCOMPILED
from posse.numeric.lanes import LanesType, tuple_of_lanes
from posse.rules.state import CONFIG, OBSTACLE, SCRATCH, SLOT, TRACKER, world_record
from posse.signals.views import Mate, View

_njit: Final[Any] = numba.njit  # Any: its types lack _nrt
_typeof: Final[Any] = numba.typeof
_LONGEST: Final = 200


def check_functions(declarations: Declarations) -> None:
    """Raise DeclarationError for a user's function that cannot be compiled. Takes some tenths of a second for each."""
    added = [each for group in declarations for each in group if not each.built_in]
    if UNCOMPILED or not added:
        return
    records = {"c": CONFIG, "w": world_record(declarations), "t": TRACKER, "s": SCRATCH}
    arrays = {"trackers": TRACKER, "obstacles": OBSTACLE, "slots": SLOT}
    known: dict[str, Any] = {
        **{name: _typeof(np.zeros(1, dtype)[0]) for name, dtype in records.items()},
        **{name: _typeof(np.zeros(1, dtype)) for name, dtype in arrays.items()},
        "v": tuple_of_lanes(View),
        "m": tuple_of_lanes(Mate),
        "number": types.int64,
        "dx": types.float32,
        "dy": types.float32,
    }
    for declaration in added:
        for function, returns in declaration.functions.items():
            line, reason = _why_not(function, [known[name] for name in parameters_of(function)], returns)
            if reason:
                raise declaration.error(f"line {line}: {reason}", function) from None


def _why_not(function: Function, arguments: list[Any], returns: str) -> tuple[int, str]:
    """Compile a function alone; return the line and the reason of its error, or no reason."""
    alone: Any = _njit(error_model="numpy", _nrt=False)(plain(function))
    code = plain(function).__code__
    try:
        alone.compile(tuple(arguments))
    except Exception as error:  # the compiler may raise anything
        text = re.sub(r"\x1b\[[0-9;]*m", "", str(error))  # without colours
        unknown = re.search(r"Unknown attribute '(\w+)' of type", text)
        if unknown or isinstance(error, KeyError):  # an attribute of a view, or of a record
            name = unknown[1] if unknown else str(error.args[0])
            near = difflib.get_close_matches(name, {each for kind in arguments for each in getattr(kind, "fields", ())})
            hint = f" (did you mean {' or '.join(map(repr, near))}?)" if near else ""
            places = [each.positions for each in dis.get_instructions(code) if each.argval == name]
            return next(
                (at.lineno for at in places if at and at.lineno), code.co_firstlineno
            ), f"there is no field {name!r}{hint}"
        lines = re.findall(rf'{re.escape(Path(code.co_filename).name)}(?:" *, line | \()(\d+)', text)
        return int(lines[-1]) if lines else code.co_firstlineno, _short(_first_line(text))
    found: Any = alone.overloads[tuple(arguments)].signature.return_type
    return code.co_firstlineno, "" if _fits(found, returns) else f"it returns {_short(str(found))}, not {returns}"


def _fits(found: Any, returns: str) -> bool:
    if returns == "nothing":
        return isinstance(found, types.NoneType)
    if returns == "True or False":
        return isinstance(found, (types.Integer, types.Boolean))
    if returns == "a number":
        return isinstance(found, (types.Integer, types.Float, types.Boolean, LanesType))
    numbers = [_fits(each, "a number") for each in found] if isinstance(found, types.BaseTuple) else []  # type: ignore[attr-defined]
    return all(numbers) and returns == f"{len(numbers)} numbers"


def _first_line(text: str) -> str:
    """Return the first line of the compiler's message that says something."""
    if "NRT required" in text:
        return "it creates an array, a list or a text, which compiled functions may not"
    lines = [line.strip() for line in text.splitlines()]
    said = [line for line in lines if line and "Failed in nopython mode" not in line] or ["it cannot be compiled"]
    call = next((line[3:].strip() for line in said if line.startswith(">>>")), None)
    return said[0] if call is None else f"{call}: no such function of these types"


def _short(text: str) -> str:
    text = re.sub(r"Record\(.*?;\d+;(?:True|False)\)", "a record", text, flags=re.DOTALL)
    text = re.sub(r"\b(View|Mate)\((?:Lanes|Mask)[^)]*\)", r"\1", text)
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"
