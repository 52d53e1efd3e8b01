"""Hashes of functions with all that they reach."""

from __future__ import annotations

import contextlib
import dis
import enum
import functools
import hashlib
import importlib.metadata
import os
import platform
from collections.abc import Callable, Iterable
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any, Final

import numba
import numpy as np
from numba.core import types
from numba.core.registry import CPUDispatcher

_CONFIG: Final[Any] = numba.config  # Any: numba sets its names at run time
_POSSE: Final = Path(__file__).resolve().parents[1]
_SOURCES: Final = hashlib.sha256(b"".join(path.read_bytes() for path in sorted(_POSSE.rglob("*.py")))).hexdigest()
_VERSIONS: Final = (
    platform.python_version(),
    *(importlib.metadata.version(name) for name in ("numba", "llvmlite", "numpy")),
    _CONFIG.OPT,  # debugging options that change the machine code
    _CONFIG.BOUNDSCHECK,
)
_PROCESS: Final = os.urandom(16)
_known: dict[Any, bytes] = {}  # hashes of functions at the last stamp
_unknown: dict[int, Any] = {}  # values that cannot be hashed; kept, so that no other gets their address
_compiled_with: dict[Any, bytes] = {}  # hashes of users' own numba functions


def stamp(*functions: Callable[..., Any]) -> str:
    """Return a hash of functions with all that they reach, as it is now.

    Functions of posse count by its sources; others by their code, defaults, closures, and the globals and attributes
    of modules that they name, recursively.
    """
    _known.clear()
    return _hash(_VERSIONS, _SOURCES, list(map(digest, functions))).hex()


def describe(kinds: Iterable[Any]) -> list[Any]:
    """Return the names of numba's types, with the fields of named tuples, which those names lack."""
    return [(str(k), digest(getattr(k, "instance_class", None)), describe(getattr(k, "types", ()))) for k in kinds]


def _hash(*parts: object) -> bytes:
    return hashlib.sha256(repr(parts).encode()).digest()


def digest(value: Any, names: frozenset[str] = frozenset()) -> bytes:
    """Return a hash of a value that compiled code may hold; of a module, only what has one of the names."""
    function = getattr(value, "py_func", getattr(value, "_defn", value))  # compiled, or numba's intrinsic
    if isinstance(function, FunctionType):
        found = _digest_function(function)
        if type(value) is CPUDispatcher:
            if _compiled_with.get(value, found) != found or (value not in _compiled_with and value.overloads):
                value.recompile()
            _compiled_with[value] = found
        return found
    if isinstance(value, ModuleType):
        inside = () if value.__name__.partition(".")[0] in ("numba", "numpy") else sorted(names)
        reached = [(n, digest(getattr(value, n), names - {n})) for n in inside if hasattr(value, n)]
        return _hash(value.__name__, reached)
    if isinstance(value, np.ndarray | np.generic):
        return _hash(value.dtype, np.shape(value), np.asarray(value).tobytes())
    if isinstance(value, type):
        members = [(name, digest(each.value)) for name, each in getattr(value, "__members__", {}).items()]
        return _hash(value.__qualname__, getattr(value, "_fields", ()), members)
    if isinstance(value, enum.Enum):
        return _hash(digest(type(value)), value.name)
    if isinstance(value, tuple | list):
        return _hash(digest(type(value)), list(map(digest, value)))
    if isinstance(value, dict | set | frozenset):
        items = value.items() if isinstance(value, dict) else value
        return _hash(type(value).__name__, sorted(map(digest, items)))
    if value is None or isinstance(value, bool | int | float | complex | str | bytes | types.Type | np.dtype):
        return _hash(type(value).__name__, value)
    if isinstance(value, BuiltinFunctionType | np.ufunc):
        return _hash(value.__name__)
    return _hash(_PROCESS, id(_unknown.setdefault(id(value), value)))


def _digest_function(function: FunctionType) -> bytes:
    if function not in _known:
        _known[function] = b"itself"  # if it is recursive
        code, names = function.__code__, _names(function.__code__)[1]
        reached = [digest(function.__defaults__), digest(function.__kwdefaults__)]
        for cell in function.__closure__ or ():
            with contextlib.suppress(ValueError):  # empty
                reached.append(digest(cell.cell_contents, names))
        if not code.co_filename.startswith(f"{_POSSE}{os.sep}"):
            reached.append(_digest_code(code, function.__globals__))
        _known[function] = _hash(function.__name__, reached)
    return _known[function]


def _digest_code(code: CodeType, scope: dict[str, Any]) -> bytes:
    read, names = _names(code)
    constants = [_digest_code(c, scope) if isinstance(c, CodeType) else digest(c) for c in code.co_consts]
    reached = [(name, digest(scope[name], names)) for name in sorted(read) if name in scope]
    return _hash(code.co_code, code.co_names, code.co_varnames, code.co_freevars, constants, reached)


@functools.cache
def _names(code: CodeType) -> tuple[frozenset[str], frozenset[str]]:
    """Return the names of the globals that code reads, and of attributes, those of functions inside it too."""
    named = [step for step in dis.get_instructions(code) if isinstance(step.argval, str)]
    read = frozenset(step.argval for step in named if step.opname in ("LOAD_GLOBAL", "LOAD_NAME"))
    others = (_names(each)[1] for each in code.co_consts if isinstance(each, CodeType))
    return read, frozenset(step.argval for step in named if "ATTR" in step.opname or "METHOD" in step.opname).union(
        *others
    )
