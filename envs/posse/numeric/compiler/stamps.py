"""Hashes of the sources of a kernel; a cached kernel is valid while its hash is unchanged.

Functions of many files are inlined into a kernel. The hash covers the packages of the kernel and of
every function that it calls, and the values that become constants in its code.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import pickle
import platform
from collections.abc import Callable, Iterable
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any, Final

import numba
import numpy as np

_POSSE: Final = Path(__file__).resolve().parents[2]
_NO_KERNELS: Final = {
    "posse": ("adapters", "rendering"),
    "posse_training": (
        "commands",
        "datasets",
        "leaderboard",
        "league",
        "play",
        "replay",
        "reports",
        "runs",
        "shipping",
        "tuning",
    ),
}
"""Rooms without compiled code, by package; kernels do not depend on them."""

_STAMPED_BY_VERSION: Final = ("numba", "llvmlite", "numpy")
_CONFIG: Final[Any] = numba.config  # Any: numba sets its names at run time
_COMPILERS: Final = (
    platform.python_implementation(),
    platform.python_version(),
    *(importlib.metadata.version(name) for name in _STAMPED_BY_VERSION),
    # Debugging options that change the machine code.
    str(_CONFIG.BOUNDSCHECK),
    str(_CONFIG.OPT),
)


@functools.cache
def _source(filename: str) -> Path | None:
    """Return a file's outermost package, the file itself if it has none, or None without a file."""
    path = Path(filename).resolve()
    if not path.is_file():  # generated or interactive code
        return None
    source = path
    for directory in path.parents:
        if not (directory / "__init__.py").is_file():
            break
        source = directory
    return source


def _read(source: Path) -> bytes:
    """Return a hash of a file, or of a package's file names and contents."""
    digest = hashlib.sha256(source.name.encode())
    without = [source / room for room in _NO_KERNELS.get(source.name, ())]
    for path in sorted(source.rglob("*.py")) if source.is_dir() else [source]:
        if any(path.is_relative_to(room) for room in without):
            continue
        try:
            content = path.read_bytes()
        except OSError:  # deleted since it was listed
            content = b""
        digest.update(path.relative_to(source.parent).as_posix().encode())
        digest.update(hashlib.sha256(content).digest())
    return digest.digest()


# Cached, since a process keeps running what it imported even if the file changes later.
_as_imported: Final = functools.cache(_read)


def remember(function: Callable[..., Any]) -> None:
    """Hash a function's source now, before the file can change."""
    source = _source(function.__code__.co_filename)
    for each in (_POSSE, source):
        if each is not None:
            _as_imported(each)


class Stamp:
    """A hash of the sources and constants of a kernel.

    Args:
        function: The kernel.
        others: Functions that it calls but that its globals and closure do not refer to.

    Raises:
        TypeError: A constant of the code cannot be hashed.
    """

    def __init__(self, function: Callable[..., Any], others: Iterable[Callable[..., Any]]) -> None:
        self._sources = {_POSSE}
        self._seen: set[int] = set()
        self._digest = hashlib.sha256(repr(_COMPILERS).encode())
        for each in (function, *others):
            self._add(each)
        for source in sorted(self._sources):
            self._digest.update(_as_imported(source))

    def hexdigest(self, *more: str) -> str:
        """Return the hash, with further strings that the machine code depends on."""
        digest = self._digest.copy()
        digest.update(repr(more).encode())
        return digest.hexdigest()

    def holds(self) -> bool:
        """Return whether the sources are unchanged since this process imported them."""
        return all(_read(source) == _as_imported(source) for source in self._sources)

    def _add(self, value: Any) -> None:
        value = getattr(value, "py_func", value)
        if isinstance(value, FunctionType):
            if id(value) not in self._seen:
                self._seen.add(id(value))
                self._add_function(value)
        elif isinstance(value, tuple | list):
            self._write(type(value).__name__, len(value))
            for each in value:
                self._add(each)
        elif isinstance(value, np.ndarray | np.generic):
            self._write(np.asarray(value).dtype.descr, np.shape(value))
            self._digest.update(np.asarray(value).tobytes())
        elif isinstance(value, type | ModuleType):
            self._write(getattr(value, "__module__", ""), value.__name__)
        elif value is None or isinstance(value, bool | int | float | str | bytes):
            self._write(value)
        else:
            try:
                self._digest.update(pickle.dumps(value))
            except Exception as error:
                raise TypeError(f"cannot hash {type(value).__name__}") from error

    def _add_function(self, function: FunctionType) -> None:
        self._write(function.__module__, function.__qualname__)
        if function.__module__.partition(".")[0] in _STAMPED_BY_VERSION:
            return
        source = _source(function.__code__.co_filename)
        if source is not None:
            self._sources.add(source)
        for cell in function.__closure__ or ():
            self._add(cell.cell_contents)
        if source != _POSSE:
            self._add(function.__defaults__)
            self._add_code(function.__code__, function.__globals__)

    def _add_code(self, code: CodeType, scope: dict[str, Any]) -> None:
        """Add the bytecode, which is what numba compiles, and the globals that it refers to."""
        self._write(code.co_code, code.co_names, code.co_varnames)
        for constant in code.co_consts:
            if isinstance(constant, CodeType):
                self._add_code(constant, scope)
            else:
                self._write(sorted(map(repr, constant)) if type(constant) is frozenset else constant)
        self._add_named(code.co_names, scope)

    def _add_named(self, names: tuple[str, ...], scope: dict[str, Any]) -> None:
        for name in names:
            value = scope.get(name)
            self._add(value)
            if isinstance(value, ModuleType) and id(value) not in self._seen:
                self._seen.add(id(value))
                self._add_named(names, vars(value))

    def _write(self, *values: Any) -> None:
        self._digest.update(repr(values).encode())
