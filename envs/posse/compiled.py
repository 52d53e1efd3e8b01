"""How functions are compiled: the one place that knows numba's options and where kernels are kept.

Two decorators. :func:`compiled` is for the small scalar functions that say one thing about one
robot or one world. :func:`kernel` is for the few functions that Python calls, each of which
compiles everything below it: what it compiles to is kept on disk, so that only the first process
after a change waits for the compiler.

numba has an on-disk cache too, but it looks at the file of the kernel alone, so an edited helper in
another file would leave a stale kernel in use. Here a kernel is filed under a stamp of *all* the
sources of its package and of this one, and of the versions that compiled it. A package whose
kernels call compiled functions of a third package is not covered: such a kernel belongs
under :func:`compiled`.

No fast-math, here or anywhere: a result must not depend on the place of a world in its batch.
With ``NUMBA_DISABLE_JIT=1`` both decorators return the plain function, for debugging.
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
from typing import Any, Final, TypeVar, cast, overload

import numba
from numba.core import types
from numba.core.caching import CompileResultCacheImpl, FunctionCache, _CacheLocator
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.registry import CPUDispatcher

F = TypeVar("F", bound=Callable[..., Any])

# error_model="numpy": division by zero gives inf or nan, as in numpy, and no branch to raise from.
# nogil: other Python threads run on while a batch is stepped.
# _nrt: no reference counts, so nothing compiled may make an array (a reduction over prange does).
_OPTIONS: Final[dict[str, Any]] = {
    "nogil": True,
    "error_model": "numpy",
    "_nrt": False,
}

# How a compiled function is compiled for the kernels that link it.
_LINKED: Final = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}

# Any: numba sets these names at run time, so type checkers cannot know them.
_CONFIG: Final[Any] = numba.config

_HERE: Final = Path(__file__).resolve().parent
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


@overload
def compiled(function: F) -> F: ...


@overload
def compiled(*, seldom: bool = ...) -> Callable[[F], F]: ...


def compiled(function: F | None = None, *, seldom: bool = False) -> F | Callable[[F], F]:
    """Compile a function that kernels, and other compiled functions, call.

    Written as ``@compiled``: it becomes part of whatever calls it. Or as
    ``@compiled(seldom=True)`` for what is long and seldom run: it stays by itself, so that what
    runs in every step lies close together and fits the processor's cache of instructions.
    """

    def decorate(function: F) -> F:
        if _CONFIG.DISABLE_JIT:
            return function
        _package_stamp(_package_directory(function))
        return cast("F", _Function(function, inline=not seldom))

    return decorate if function is None else decorate(function)


class _Function(CPUDispatcher):
    """A compiled function: one form of it for Python to call, one for kernels to link.

    numba would optimise each function by itself, turn it into machine code and wrap it for Python,
    and then do all of that again in every function that calls it. Kernels take in everything below
    them and are optimised as a whole, so the form that they link skips it: this halves the time to
    compile. They take it in at each call unless told otherwise: to call a function with arrays
    costs more than most of ours take, since each array is passed in parts. The form for Python is
    compiled only if Python calls it (a test, a prompt).
    """

    def __init__(self, function: Callable[..., Any], inline: bool) -> None:
        options = {**_OPTIONS, "nopython": True, "boundscheck": None}
        super().__init__(function, targetoptions=options)
        self._linked = CPUDispatcher(
            function,
            targetoptions={**options, **_LINKED, "forceinline": inline},
            pipeline_class=_LinkedForm,
        )

    @property
    def _numba_type_(self) -> types.Dispatcher:
        """What compiled code takes this function for."""
        return types.Dispatcher(self._linked)


class _LinkedForm(CompilerBase):
    """numba's compiler, its output kept for the linker."""

    def define_pipelines(self) -> list[Any]:
        state = self.state
        codegen, name = state.targetctx.codegen(), state.func_id.func_qualname
        state.library = _LinkedLibrary(codegen, name)  # type: ignore[no-untyped-call]
        pipeline = DefaultPassBuilder.define_nopython_pipeline(state)  # type: ignore[no-untyped-call]
        return [pipeline]


class _LinkedLibrary(JITCodeLibrary):
    """LLVM code that waits for a kernel to link, optimise and run it."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True  # and not handed to the engine, which would make machine code

    @property
    def codegen(self) -> Any:
        """What numba gives the function's Python environment to: there is none."""
        return _NoEnvironment


class _ShortLoops(CompilerBase):
    """numba's compiler, optimising for loops that are short."""

    def define_pipelines(self) -> list[Any]:
        state = self.state
        codegen, name = state.targetctx.codegen(), state.func_id.func_qualname
        state.library = _ShortLoopsLibrary(codegen, name)  # type: ignore[no-untyped-call]
        state.library.enable_object_caching()
        pipeline = DefaultPassBuilder.define_nopython_pipeline(state)  # type: ignore[no-untyped-call]
        return [pipeline]


class _ShortLoopsLibrary(JITCodeLibrary):
    """LLVM code whose vectors come from what stands side by side, not from turns of a loop."""

    def _optimize_final_module(self) -> None:
        # Once, not twice: numba's first round serves its reference counts, of which there are none.
        codegen: Any = self._codegen
        passes, builder = codegen._module_pass_manager(loop_vectorize=False, slp_vectorize=True)
        passes.run(self._final_module, builder)


class _NoEnvironment:
    @staticmethod
    def set_env(name: str, environment: Any) -> None:
        pass


@overload
def kernel(function: F) -> F: ...


@overload
def kernel(*, short_loops: bool = ...) -> Callable[[F], F]: ...


def kernel(function: F | None = None, *, short_loops: bool = False) -> F | Callable[[F], F]:
    """Compile a function that Python calls, and keep the result on disk.

    Written as ``@kernel``, or as ``@kernel(short_loops=True)`` where the inner loops are short
    (over trackers, beams, places). Those are not vectorised as loops, since to find out at run
    time whether one is long enough takes longer than the loop; a loop of fixed length (over a
    block of eight, say) is unrolled instead, and its turns are done at once.

    The directory is ``$POSSE_CACHE_DIR``, or ``posse`` in the user's cache directory. Where it
    cannot be written, and for functions outside a package (a script, a notebook), every process
    compiles for itself.
    """

    def decorate(function: F) -> F:
        if _CONFIG.DISABLE_JIT:
            return function
        package = _package_directory(function)
        _package_stamp(package)
        options = {**_OPTIONS, "pipeline_class": _ShortLoops} if short_loops else _OPTIONS
        dispatcher = numba.njit(**options)(function)
        if package is not None and _cache_directory() is not None:
            dispatcher._cache = _KernelCache(function)  # type: ignore[no-untyped-call]
        return cast("F", dispatcher)

    return decorate if function is None else decorate(function)


def direct(function: F) -> F:
    """Return a kernel's compiled form, which takes its arguments for what they were the first time.

    numba's own call looks up the type of every argument, which takes longer than a world's step.
    Whoever calls the compiled form has to pass arguments of just those types. Where a kernel has
    not been called yet, or has been with several types, it is returned as it is.
    """
    forms = list(getattr(function, "overloads", {}).values())
    return cast("F", forms[0].entry_point) if len(forms) == 1 else function


def _package_directory(function: Callable[..., Any]) -> Path | None:
    """The directory of a function's top-level package, or None for a module of no package."""
    package = sys.modules.get(function.__module__.partition(".")[0])
    for directory in getattr(package, "__path__", ()):
        return Path(directory).resolve()
    return None


def _cache_directory() -> Path | None:
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
def _package_stamp(package: Path | None) -> bytes:
    """The hash of a package's sources when its first function was decorated.

    Remembered, since this process goes on with the sources that it has imported, whatever is
    written to them later.
    """
    return b"" if package is None else _hash_sources(package)


class _Locator(_CacheLocator):
    """Where the compiled forms of one kernel lie, and what they were compiled from."""

    def __init__(self, function: Callable[..., Any], source_file: str, directory: Path) -> None:
        package = _package_directory(function)
        assert package is not None
        self._packages = sorted({_HERE, package})
        self._module = function.__module__
        self._line = function.__code__.co_firstlineno
        self._py_file = source_file  # numba names it in its warnings
        digest = hashlib.sha256(repr(_COMPILERS).encode())
        for each in self._packages:
            digest.update(_package_stamp(each))
        self._stamp = digest.hexdigest()[:20]
        self.root = directory
        self._directory = directory / f"kernels-{self._stamp}"

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> _Locator | None:
        """The locator of a kernel (numba's name for it)."""
        directory = _cache_directory()
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
        return all(_hash_sources(each) == _package_stamp(each) for each in self._packages)


class _KernelCacheImpl(CompileResultCacheImpl):
    _locator_classes: list[Any] = [_Locator]  # noqa: RUF012 (so declared by numba)


class _KernelCache(FunctionCache):
    """Numba's cache of one function, filed by the sources of whole packages.

    A directory that cannot be read or written costs the time to compile, and never an error.
    """

    _impl_class = _KernelCacheImpl

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            found = super().load_overload(sig, target_context)  # type: ignore[no-untyped-call]
        except (OSError, EOFError, pickle.UnpicklingError):
            found = None
            with contextlib.suppress(OSError):
                self.flush()  # type: ignore[no-untyped-call]  # a damaged index: begin a new one
        if found is None:
            _announce(self._is_writable(), self._impl.locator.root)
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
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
