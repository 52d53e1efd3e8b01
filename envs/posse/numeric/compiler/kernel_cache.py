"""Where kernels are kept on disk, and when one may be used again.

numba has an on-disk cache too, but it looks at the file of the kernel alone, so an edited helper in
another file would leave a stale kernel in use. Here a kernel is filed under a stamp of *all* the
sources of its package and of this one, and of the versions that compiled it. A package whose
kernels call compiled functions of a third package is not covered: such a kernel belongs
under :func:`posse.numeric.compiling.compiled`.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib.metadata
import os
import pickle
import platform
import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator

# Any: numba sets these names at run time, so type checkers cannot know them.
_CONFIG: Final[Any] = numba.config

_HERE: Final = Path(__file__).resolve().parents[2]
_KEPT_STAMPS: Final = 16
_STAMP_DIRECTORY: Final = re.compile(r"kernels-[0-9a-f]{20}")
_COMPILERS: Final = (
    platform.python_implementation(),
    platform.python_version(),
    *(importlib.metadata.version(name) for name in ("numba", "llvmlite", "numpy")),
    # Debugging switches that change the machine code.
    str(_CONFIG.BOUNDSCHECK),
    str(_CONFIG.OPT),
)


def package_directory(function: Callable[..., Any]) -> Path | None:
    """The directory of a function's top-level package, or None for a module of no package."""
    package = sys.modules.get(function.__module__.partition(".")[0])
    for directory in getattr(package, "__path__", ()):
        return Path(directory).resolve()
    return None


def cache_directory() -> Path | None:
    """Where kernels are kept, or None where there is not even a home directory."""
    chosen = os.environ.get("POSSE_CACHE_DIR")
    if chosen:
        return Path(chosen).absolute()
    user_cache = os.environ.get("XDG_CACHE_HOME")
    if user_cache:
        return Path(user_cache).absolute() / "posse"
    try:
        return Path.home() / ".cache" / "posse"
    except RuntimeError:
        return None


def _hash_sources(package: Path) -> bytes:
    """A hash over the names and contents of all Python files of a package."""
    digest = hashlib.sha256(package.name.encode())
    for path in sorted(package.rglob("*.py")):
        try:
            content = path.read_bytes()
        except OSError:  # an editor's temporary file that is gone by now
            content = b""
        digest.update(path.relative_to(package).as_posix().encode())
        digest.update(hashlib.sha256(content).digest())
    return digest.digest()


@functools.cache
def package_stamp(package: Path | None) -> bytes:
    """The hash of a package's sources when its first function was decorated.

    Remembered, since this process goes on with the sources that it has imported, whatever is
    written to them later.
    """
    return b"" if package is None else _hash_sources(package)


class _Locator(_CacheLocator):
    """Where the compiled forms of one kernel lie, and what they were compiled from."""

    def __init__(self, function: Callable[..., Any], source_file: str, directory: Path) -> None:
        package = package_directory(function)
        assert package is not None
        self._packages = sorted({_HERE, package})
        self._module = function.__module__
        self._line = function.__code__.co_firstlineno
        self._py_file = source_file  # numba names it in its warnings
        digest = hashlib.sha256(repr(_COMPILERS).encode())
        for each in self._packages:
            digest.update(package_stamp(each))
        self._stamp = digest.hexdigest()[:20]
        self.root = directory
        self._directory = directory / f"kernels-{self._stamp}"

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> _Locator | None:
        """The locator of a kernel (numba's name for it)."""
        directory = cache_directory()
        return None if directory is None else cls(py_func, py_file, directory)

    def get_cache_path(self) -> str:
        """The directory of this kernel's stamp."""
        return str(self._directory)

    def get_source_stamp(self) -> str:
        """What the compiled form depends on, apart from the processor, which numba adds."""
        return self._stamp

    def get_disambiguator(self) -> str:
        """What tells this kernel from others of the same name."""
        return f"{self._module}-{self._line}"

    def sources_are_as_imported(self) -> bool:
        """Whether the files still hold what this process imported."""
        return all(_hash_sources(each) == package_stamp(each) for each in self._packages)


class _Impl(CompileResultCacheImpl):
    _locator_classes: list[Any] = [_Locator]  # noqa: RUF012 (so declared by numba)


class KernelCache(FunctionCache):
    """Numba's cache of one function, filed by the sources of whole packages.

    A directory that cannot be read or written costs the time to compile, and never an error.
    """

    _impl_class = _Impl

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        """Return what tells compiled forms apart (numba's name for it).

        A function in the kernel's closure counts by its name: its sources are in the stamp.
        """
        cells = [cell.cell_contents for cell in self._py_func.__closure__ or ()]
        named = [(cell.__module__, cell.__qualname__) if callable(cell) else cell for cell in cells]
        return sig, codegen.magic_tuple(), hashlib.sha256(pickle.dumps(named)).hexdigest()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return a kernel's compiled form, or None where it has to be compiled."""
        try:
            # Not numba's own load_overload: that first gets everything ready to compile, which
            # takes longer than all else to the first step, and is done anyway by who compiles.
            found = None
            with self._guard_against_spurious_io_errors():
                found = self._load_overload(sig, target_context)  # type: ignore[no-untyped-call]
        except (OSError, EOFError, pickle.UnpicklingError):
            found = None
            with contextlib.suppress(OSError):
                self.flush()  # type: ignore[no-untyped-call]  # a damaged index: begin a new one
        if found is None:
            _announce(self._is_writable(), self._impl.locator.root)
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep a kernel's compiled form, unless its sources have been edited meanwhile."""
        # Edited since it was imported: filed under its stamp, it would be taken for the new code
        # or, by a process that started in between, for the old.
        if not self._impl.locator.sources_are_as_imported():
            return
        try:
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]
        except OSError:
            return
        _prune(self._impl.locator.root)

    def _is_writable(self) -> bool:
        try:
            self._impl.locator.ensure_cache_path()
        except OSError:
            return False
        return True


@functools.cache  # once a process, however many kernels it compiles
def _announce(writable: bool, directory: Path) -> None:
    kept = f"once; kept in {directory}" if writable else f"each time; cannot write to {directory}"
    sys.stderr.write(f"posse: compiling kernels, which takes some seconds ({kept})\n")


def _prune(root: Path) -> None:
    """Drop the stamps of long ago: each edit of a source makes a new one."""
    try:
        stamps = [path for path in root.iterdir() if _STAMP_DIRECTORY.fullmatch(path.name)]
        stamps.sort(key=lambda path: path.stat().st_mtime, reverse=True)
    except OSError:
        return
    for path in stamps[_KEPT_STAMPS:]:
        shutil.rmtree(path, ignore_errors=True)
