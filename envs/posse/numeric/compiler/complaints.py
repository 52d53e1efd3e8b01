"""Compile errors of a user's function, reduced to one line."""

from __future__ import annotations

import difflib
import dis
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple, cast

import numba
from numba.core import types

from posse.numeric.simd.lane_code import LanesType

_COLOURS: Final = re.compile(r"\x1b\[[0-9;]*m")
_RECORD: Final = re.compile(r"Record\(.*?;\d+;(?:True|False)\)", re.DOTALL)
_HEADING: Final = "Failed in nopython mode"
_LONGEST: Final = 200
_ARTICLES: Final = {"nothing": "nothing", "number": "a number", "pair": "a pair", "truth": "a truth"}


class Complaint(NamedTuple):
    """An error in a function."""

    line: int
    reason: str


def unknown_attribute(function: Callable[..., Any], attributes: Mapping[str, Iterable[str]]) -> Complaint | None:
    """Return the first use of an attribute that a parameter lacks, or None.

    Args:
        function: Plain or compiled.
        attributes: Attributes of each parameter by name; other parameters are not checked.
    """
    code = getattr(function, "py_func", function).__code__
    instructions = list(dis.get_instructions(code))
    known = dict(attributes)
    for each in instructions:
        if each.opname.startswith("STORE_FAST") and isinstance(each.argval, str):
            known.pop(each.argval, None)  # reassigned
    of = ""
    for each in instructions:
        if of in known and each.opname in ("LOAD_ATTR", "LOAD_METHOD", "STORE_ATTR"):
            names = tuple(known[of])
            if each.argval not in names:
                line = each.positions.lineno if each.positions else None
                near = difflib.get_close_matches(each.argval, names, n=3) or names
                reason = f"{of} has no field {each.argval!r}; it has {_short(', '.join(near))}"
                return Complaint(line or code.co_firstlineno, reason)
        loaded = each.argval[-1] if isinstance(each.argval, tuple) else each.argval
        of = loaded if "LOAD_FAST" in each.opname else ""
    return None


def why_not_compiled(function: Callable[..., Any], arguments: Sequence[Any], returns: str) -> Complaint | None:
    """Compile a function alone for the given numba types; return its error, or None.

    Args:
        function: Plain or compiled.
        arguments: Types of the arguments.
        returns: Required result: ``"nothing"``, ``"number"``, ``"pair"``, ``"truth"``, or a tuple
            such as ``"3 numbers"``. Lanes count as a number.
    """
    plain = getattr(function, "py_func", function)
    code = plain.__code__
    try:
        alone = numba.njit(error_model="numpy")(plain)
        alone.compile(tuple(arguments))
        form: Any = alone.overloads[tuple(arguments)]
        found: Any = form.signature.return_type
    except KeyError as error:  # raised by numba for an unknown field
        return Complaint(code.co_firstlineno, f"a record that it reads has no field {error}")
    except Exception as error:  # the compiler may raise anything
        text = _COLOURS.sub("", str(error))
        return Complaint(_line(text, code), _reason(text))
    count, _, numbers = returns.partition(" ")
    fits = {
        "nothing": isinstance(found, types.NoneType),
        "number": _is_number(found),
        f"{count} {numbers}": isinstance(found, types.BaseTuple)
        and str(len(found)) == count
        and all(map(_is_number, cast("Iterable[Any]", found))),
        "pair": isinstance(found, types.BaseTuple) and len(found) == 2,
        "truth": isinstance(found, (types.Integer, types.Boolean)),
    }[returns]
    wrong = f"it returns {_short(str(found))}, not {returns if numbers else _ARTICLES[returns]}"
    return None if fits else Complaint(code.co_firstlineno, wrong)


def _is_number(found: Any) -> bool:
    return isinstance(found, (types.Number, types.Boolean, LanesType))


def _line(text: str, code: Any) -> int:
    """Return the last line of the function named in the compiler's message."""
    file = re.escape(Path(code.co_filename).name)
    lines = re.findall(rf'{file}(?:" *, line | \()(\d+)', text)
    return int(lines[-1] if lines else code.co_firstlineno)


def _reason(text: str) -> str:
    lines = [line.strip() for line in text.splitlines()]
    said = [line for line in lines if line and not line.startswith(_HEADING)] or ["not compilable"]
    call = next((line[3:].strip() for line in said if line.startswith(">>>")), None)
    return _short(said[0] if call is None else f"{call}: no such function of these types")


def _short(text: str) -> str:
    text = _RECORD.sub("a record", text)
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"
