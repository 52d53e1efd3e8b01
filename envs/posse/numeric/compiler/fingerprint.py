"""A hash of what a function of a user's module compiles to: its code, and all that it uses.

Wherever it stands (a package, a script, a notebook), and whether or not its file can be read.
"""

from __future__ import annotations

import hashlib
import types
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np


def fingerprint(function: Callable[..., Any]) -> str:
    """Return a hash over a function's code, the constants that it uses, and what it calls."""
    digest = hashlib.sha256()
    for part in _parts(function, set()):
        digest.update(repr(part).encode())
    return digest.hexdigest()[:16]


def _parts(function: Any, seen: set[int]) -> Iterator[object]:
    plain = getattr(function, "py_func", function)
    code = getattr(plain, "__code__", None)
    if code is None or id(plain) in seen:
        yield getattr(plain, "__qualname__", type(plain).__qualname__)
        return
    seen.add(id(plain))
    yield from _code_parts(code)
    yield plain.__defaults__, plain.__kwdefaults__
    for cell in plain.__closure__ or ():
        yield from _value_parts(cell.cell_contents, seen)
    for name in sorted(_names(code)):
        if name in plain.__globals__:
            yield name
            yield from _value_parts(plain.__globals__[name], seen, _names(code))


def _value_parts(
    value: Any, seen: set[int], names: frozenset[str] = frozenset()
) -> Iterator[object]:
    if isinstance(value, types.ModuleType):
        if value.__name__.partition(".")[0] in ("numpy", "math", "posse"):
            return  # versions of these are in the stamp
        for name in sorted(names & vars(value).keys()):
            yield name
            yield from _value_parts(vars(value)[name], seen)
    elif isinstance(value, np.ndarray):
        yield value.dtype, value.shape, value.tobytes()
    elif callable(value):
        if getattr(value, "__module__", None) is None or _is_posse(value):
            yield getattr(value, "__qualname__", repr(value))
        else:
            yield from _parts(value, seen)
    else:
        yield value


def _is_posse(value: Any) -> bool:
    return str(value.__module__).partition(".")[0] == "posse"


def _code_parts(code: types.CodeType) -> Iterator[object]:
    yield code.co_code
    yield code.co_names, code.co_varnames
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _code_parts(constant)
        else:
            yield constant


def _names(code: types.CodeType) -> frozenset[str]:
    inner = [_names(each) for each in code.co_consts if isinstance(each, types.CodeType)]
    return frozenset(code.co_names).union(*inner)
