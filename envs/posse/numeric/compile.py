"""Compile functions to machine code, and keep kernels on disk.

:func:`compiled` is for functions of one robot or one world, :func:`kernel` for the few that Python calls. There is no
fast-math, since a result must not depend on a world's place in its batch. With ``NUMBA_DISABLE_JIT=1`` they return the
plain function, for debugging.
"""

import contextlib
import functools
import hashlib
import inspect
import io
import os
import pickle
import sys
from collections.abc import Callable
from pathlib import Path
from types import CodeType, FunctionType, ModuleType, SimpleNamespace
from typing import Any, Final, TypeVar, cast

import llvmlite.binding as llvm
import numba
import numpy as np
from numba.core import caching, codegen, compiler, registry, serialize, types

F = TypeVar("F", bound=Callable[..., Any])

_CONFIG: Final[Any] = numba.config  # Any: numba sets its names at run time
UNCOMPILED: Final = bool(_CONFIG.DISABLE_JIT)  # everything runs as plain Python

# error_model="numpy": division by zero gives inf or nan, as in numpy, and no branch to raise from.
# nogil: other Python threads run while a batch is stepped.
# _nrt: no reference counts, so compiled code may not create arrays.
_OPTIONS: Final[dict[str, Any]] = {"nopython": True, "nogil": True, "error_model": "numpy", "_nrt": False}


def compiled(function: F) -> F:
    """Compile a function that is inlined into kernels and other compiled functions, since passing arrays takes long."""
    return function if UNCOMPILED else cast("F", _Function(function))


def kernel(function: F) -> F:
    """Compile a function that is called from Python with arrays that do not overlap.

    The machine code is kept in ``$POSSE_CACHE_DIR``, or ``posse`` in the user's cache directory. It is compiled again
    if a source of posse changes, or anything that a function from elsewhere reaches (:func:`stamp`).
    """
    if UNCOMPILED:
        return np.errstate(over="ignore", under="ignore")(function)  # compiled code does not warn
    dispatcher: Any = registry.CPUDispatcher(function, {}, _OPTIONS, _Compiler)
    dispatcher._cache = _Cache(function)
    return cast("F", dispatcher)


_POSSE: Final = Path(__file__).resolve().parents[1]
_SOURCES: Final = hashlib.sha256(b"".join(path.read_bytes() for path in sorted(_POSSE.rglob("*.py")))).digest()
_PROCESS: Final = os.urandom(16)
_known: dict[FunctionType, bytes] = {}  # hashes of functions at the last stamp


def stamp(*values: Any) -> str:
    """Return a hash of values as they are now; of a function with its code, defaults and what it names, recursively."""
    _known.clear()
    versions = sys.version, numba.__version__, np.__version__, llvm.llvm_version_info, _CONFIG.OPT, _CONFIG.BOUNDSCHECK
    return _digest((_SOURCES, versions, values)).hex()


def _digest(value: Any) -> bytes:
    pickler = _Reached(file := io.BytesIO())
    pickler.fast = True  # equal objects are written alike, whether they are one or two
    pickler.dump(value)
    return hashlib.sha256(file.getvalue()).digest()


class _Reached(pickle.Pickler):
    """Writes what is hashed: functions with all that they reach, classes by what compiled code sees of them."""

    def reducer_override(self, value: Any) -> Any:
        function = getattr(value, "py_func", value)
        if isinstance(function, FunctionType):
            if function not in _known:
                _known[function] = b"itself"  # if it is recursive
                _known[function] = _digest(_parts_of(function))
            if type(value) is registry.CPUDispatcher and vars(value).get("reached") != _known[function]:  # a user's own
                value.recompile()
                vars(value)["reached"] = _known[function]
            return repr, (_known[function],)
        if isinstance(value, CodeType):  # without places in its file
            return repr, ((value.co_code, value.co_consts, value.co_names, value.co_varnames, value.co_freevars),)
        if isinstance(value, types.Type):  # the name of a named tuple's type lacks its fields
            return repr, ((str(value), value.key),)
        if isinstance(value, (ModuleType, type)):
            return repr, ((value.__name__, getattr(value, "_fields", ()), repr(getattr(value, "__members__", ""))),)
        with contextlib.suppress(Exception):  # pickle may raise anything
            pickle.dumps(value)
            return NotImplemented
        return repr, ((_PROCESS, id(value)),)  # for a kernel of this process alone


def _parts_of(function: FunctionType) -> tuple[Any, ...]:
    """Return what a function says, and the values of the names in its code, in its scope and in modules found there."""
    code, scope = function.__code__, dict(inspect.getclosurevars(function).nonlocals)
    if not code.co_filename.startswith(f"{_POSSE}{os.sep}"):  # posse's globals are in its sources
        scope = {**function.__globals__, **scope}
    codes = [code]
    for each in codes:  # those within are added as they are found
        codes += (inner for inner in each.co_consts if isinstance(inner, CodeType))
    names = {name for each in codes for name in (*each.co_names, *each.co_freevars)}
    found: list[Any] = [(name, scope[name]) for name in sorted(names & scope.keys())]
    modules: set[ModuleType] = {numba, np}  # need not be looked through (again)
    for _, part in found:  # what is in modules is added as they are found
        if isinstance(part, ModuleType) and part not in modules and not part.__name__.startswith(("numba.", "numpy.")):
            modules.add(part)
            found += ((name, vars(part)[name]) for name in sorted(names & vars(part).keys()))
    return function.__module__, function.__qualname__, code, function.__defaults__, function.__kwdefaults__, found


class _Cache(caching.NullCache):
    """The machine code of a kernel in files, each under a hash of all that it depends on."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    def _path(self, sig: Any, target: Any) -> Path:
        user = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
        folder = Path(os.environ.get("POSSE_CACHE_DIR") or f"{user}/posse").expanduser().absolute()
        return folder / f"{self._function.__name__}-{stamp(self._function, tuple(sig), target)}.kernel"

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        with contextlib.suppress(Exception):  # what cannot be read is compiled
            path = self._path(sig, target_context.codegen().magic_tuple())
            written = path.read_bytes()
            if written[:32] == _digest((path.name, written[32:])):  # numba would run flipped bits
                return compiler.CompileResult._rebuild(target_context, *pickle.loads(written[32:]))  # noqa: S301
        _announce()
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        if not data.library.has_dynamic_globals:  # addresses
            with contextlib.suppress(Exception):  # no room or permission: the next process compiles, too
                path, content = self._path(sig, data.codegen.magic_tuple()), serialize.dumps(data._reduce())
                path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
                unfinished = path.with_suffix(f".{os.getpid()}")
                unfinished.write_bytes(_digest((path.name, content)) + content)
                unfinished.replace(path)


@functools.cache  # once per process
def _announce() -> None:
    sys.stderr.write("posse: compiling kernels, some seconds; if each time, set POSSE_CACHE_DIR to a writable folder\n")


class _Library(codegen.JITCodeLibrary):
    """LLVM code of a kernel, in which no loop is unrolled or vectorised, since most run a few times: 20 % faster."""

    def _optimize_final_module(self) -> None:
        options = llvm.create_pipeline_tuning_options(_CONFIG.OPT)
        options.loop_unrolling = options.loop_vectorization = False
        options.slp_vectorization = True  # of neighbouring scalars: 2 % faster
        builder = llvm.create_pass_builder(self._codegen._tm, options)
        builder.getModulePassManager().run(self._final_module, builder)


class _InnerLibrary(codegen.JITCodeLibrary):
    """LLVM code of a function, which is optimised and made machine code only where it is linked; saves 12 s."""

    codegen: Any = SimpleNamespace(set_env=lambda name, environment: None)  # numba's requires machine code

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True


class _Compiler(compiler.CompilerBase):
    """numba's passes with the libraries above: the inner one for functions without a wrapper for Python."""

    def define_pipelines(self) -> list[Any]:
        state = self.state
        library = _InnerLibrary if state.flags.no_cpython_wrapper else _Library
        state.flags.noalias = library is _Library
        state.library = library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return [compiler.DefaultPassBuilder.define_nopython_pipeline(state)]


class _Function(registry.CPUDispatcher):
    """A function that Python can call, with a form to link into kernels for each state of what it reaches."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function, {}, _OPTIONS)
        options = {**_OPTIONS, "forceinline": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        self.inner = functools.cache(lambda state: registry.CPUDispatcher(function, {}, options, _Compiler))

    @property
    def _numba_type_(self) -> types.Dispatcher:
        return types.Dispatcher(self.inner(_digest(self)))
