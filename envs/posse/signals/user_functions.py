"""Errors in functions that users' modules declare, reported by function and line."""

import re
from typing import Any, Final

import numba
import numpy as np
from numba.core import types

from posse.declarations import Declarations, Function, parameters_of, plain, unknown
from posse.numeric import UNCOMPILED, compiled
from posse.numeric.lanes import LanesType, tuple_of_lanes
from posse.rules.state import CONFIG, OBSTACLE, SCRATCH, SLOT, TRACKER, world_record
from posse.signals.views import Mate, View

_typeof: Final[Any] = numba.typeof  # Any: it has no types


def check_functions(declarations: Declarations) -> None:
    """Raise DeclarationError for a user's function that cannot be compiled. Takes some tenths of a second for each."""
    if UNCOMPILED or not declarations.added:
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
    for declaration in declarations.added:
        for function, returns in declaration.functions.items():
            reason = _why_not(function, tuple(known[name] for name in parameters_of(function)), returns)
            if reason:
                raise declaration.error(reason, function) from None


def _why_not(function: Function, arguments: tuple[Any, ...], returns: str) -> str:
    """Compile a function alone; return the reason of its error, which is numba's message with the line, or none."""
    alone: Any = compiled(plain(function))  # anew, since what it reaches may have changed
    try:
        alone.compile(arguments)
    except Exception as error:  # the compiler may raise anything
        message = re.sub(r"\x1b\[[0-9;]*m", "", str(error))  # without colours
        missing = re.search(r"Unknown attribute '(\w+)'", message)
        if missing or isinstance(error, KeyError):  # an attribute of a view, or of a record
            fields = {name for kind in arguments for name in getattr(kind, "fields", ())}
            for view in (kind for kind in arguments if isinstance(kind, types.NamedTuple)):
                parts = zip(view.fields, view.types, strict=True)
                fields |= {f"{name}.{each}" for name, part in parts for each in getattr(part, "fields", ())}
            name = missing[1] if missing else error.args[0]
            # As a part of another, such as v.own.x; those of the fix do not repeat that it is of the target.
            if here := sorted(each for each in fields if each.rpartition(".")[2] == name.removeprefix("target_")):
                return f"unknown field {name!r}; there is {' and '.join(here)}"
            return unknown("field", name, sorted(fields)).partition(";")[0]  # without the list, which fills a page
        if ">>> bool(Mask)" in message:
            line = re.search(r"line \d+", message[message.rfind("File ") :])
            return f"if takes one number, not eight: write choose(condition, one, other), {line and line[0]}"
        return message.replace("NRT required", "It creates an array, a list or a text: NRT required")
    found: Any = alone.overloads[arguments].signature.return_type
    return "" if _fits(found, returns) else f"it returns {found}, not {returns}"


def _fits(found: Any, returns: str) -> bool:
    if returns == "nothing":
        return isinstance(found, types.NoneType)
    if returns == "True or False":
        return isinstance(found, (types.Integer, types.Boolean))
    if returns == "a number":
        return isinstance(found, (types.Integer, types.Float, types.Boolean, LanesType))
    numbers = [_fits(each, "a number") for each in found] if isinstance(found, types.BaseTuple) else []  # type: ignore[attr-defined]
    return all(numbers) and returns == f"{len(numbers)} numbers"
