"""Compile functions to machine code, and keep kernels on disk.

:func:`compiled` is for functions of one robot or one world, :func:`kernel` for the few that are called from Python,
each compiled together with all that it calls. There is no fast-math, since a result must not depend on a world's
position in its batch. With ``NUMBA_DISABLE_JIT=1`` both return the plain function, for debugging.

Three of numba's inner parts are overridden; the classes at the end say what each gains.
``tests/envs/numeric/test_compile.py`` fails if a new numba lacks what is used of them.
"""

from __future__ import annotations

import contextlib
import dis
import functools
import hashlib
import os
import pickle
import sys
from collections.abc import Callable
from pathlib import Path
from types import CodeType, FunctionType, ModuleType, SimpleNamespace
from typing import Any, Final, TypeVar, cast, overload

import numba
import numpy as np
from llvmlite import __version__ as llvmlite_version
from llvmlite import binding
from numba.core import caching, codegen, compiler, extending, imputils, serialize, types
from numba.core.registry import CPUDispatcher

F = TypeVar("F", bound=Callable[..., Any])

_CONFIG: Final[Any] = numba.config  # Any: numba sets its names at run time
UNCOMPILED: Final = bool(_CONFIG.DISABLE_JIT)
"""Whether everything runs as plain Python."""

# error_model="numpy": division by zero gives inf or nan, as in numpy, and no branch to raise from.
# nogil: other Python threads run while a batch is stepped.
# _nrt: no reference counts, so compiled code may not create arrays.
_OPTIONS: Final[dict[str, Any]] = {"nopython": True, "nogil": True, "error_model": "numpy", "_nrt": False}


@overload
def compiled(function: F) -> F: ...


@overload
def compiled(*, out_of_line: bool = ...) -> Callable[[F], F]: ...


def compiled(function: F | None = None, *, out_of_line: bool = False) -> F | Callable[[F], F]:
    """Compile a function that kernels and other compiled functions call.

    ``@compiled`` inlines it into its callers, since passing arrays takes longer than most functions.
    ``out_of_line=True`` never does: long and rarely called functions would crowd the instruction cache.
    """
    if function is None:
        return functools.partial(compiled, out_of_line=out_of_line)
    return function if UNCOMPILED else cast("F", _Function(function, out_of_line))


def kernel(function: F) -> F:
    """Compile a function that is called from Python.

    The machine code is kept in ``$POSSE_CACHE_DIR``, or ``posse`` in the user's cache directory. It is compiled again
    if a source of posse changes, or anything that a function from elsewhere reaches (:func:`stamp`).
    """
    if UNCOMPILED:
        return function
    dispatcher: Any = CPUDispatcher(function, {}, _OPTIONS, _Compiler)
    dispatcher._cache = _Cache(function)
    return cast("F", dispatcher)


def direct(function: F) -> F:
    """Return the machine code of a kernel, which does not check the types of its arguments.

    numba's dispatch looks up the type of every argument, which takes longer than a world's step. Callers must pass
    arguments of the types of the kernel's first call. A kernel that has not been called yet, or with several types, is
    returned unchanged. Uncompiled kernels do not warn of overflow, since compiled code does not.
    """
    if UNCOMPILED:
        return np.errstate(over="ignore", under="ignore")(function)
    forms = list(getattr(function, "overloads", {}).values())
    return cast("F", forms[0].entry_point) if len(forms) == 1 else function


# What a kernel depends on.

_POSSE: Final = Path(__file__).resolve().parents[1]
_SOURCES: Final = hashlib.sha256(b"".join(path.read_bytes() for path in sorted(_POSSE.rglob("*.py")))).hexdigest()
_VERSIONS: Final = (sys.version, numba.__version__, llvmlite_version, np.__version__)
_DEBUGGING: Final = (_CONFIG.OPT, _CONFIG.BOUNDSCHECK)  # options that change the machine code
_PROCESS: Final = os.urandom(16)
_known: dict[FunctionType, bytes] = {}  # hashes of functions at the last stamp
_compiled_with: dict[Any, bytes] = {}  # hashes of users' own numba functions


def stamp(*values: Any) -> str:
    """Return a hash of functions with all that they reach, and of other values, as they are now.

    Functions of posse count by its sources; others by their code, defaults, closures, and the globals and attributes
    of modules that they name, recursively.
    """
    _known.clear()
    return _hash(_VERSIONS, _DEBUGGING, _SOURCES, list(map(_digest, values))).hex()


def _hash(*parts: object) -> bytes:
    return hashlib.sha256(repr(parts).encode()).digest()


def _digest(value: Any, names: frozenset[str] = frozenset()) -> bytes:
    """Return a hash of a value that compiled code may hold; of a module, only what has one of the names."""
    function = getattr(value, "py_func", value)
    if isinstance(function, FunctionType):
        found = _digest_function(function)
        if type(value) is CPUDispatcher and _compiled_with.get(value) != found:
            value.recompile()
            _compiled_with[value] = found
        return found
    if isinstance(value, ModuleType):
        inside = () if value.__name__.partition(".")[0] in ("numba", "numpy") else sorted(names)
        reached = [(n, _digest(getattr(value, n), names - {n})) for n in inside if hasattr(value, n)]
        return _hash(value.__name__, reached)
    if isinstance(value, types.Type):  # the name of a named tuple's type lacks its fields
        return _hash(str(value), _digest(getattr(value, "instance_class", None)), _digest(getattr(value, "types", ())))
    if isinstance(value, type):
        return _hash(
            value.__qualname__, getattr(value, "_fields", ()), list(getattr(value, "__members__", {}).values())
        )
    if isinstance(value, tuple | list):
        return _hash(_digest(type(value)), list(map(_digest, value)))
    try:
        return _hash(pickle.dumps(value))
    except Exception:  # pickle may raise anything; unknown values make a kernel that this process alone uses
        return _hash(_PROCESS, id(value))


def _digest_function(function: FunctionType) -> bytes:
    if function not in _known:
        _known[function] = b"itself"  # if it is recursive
        text, read, names = _parts_of(function.__code__)
        cells = [cell.cell_contents for cell in function.__closure__ or ()]
        kept = (*cells, function.__defaults__, sorted((function.__kwdefaults__ or {}).items()))
        reached: list[Any] = [_digest(each, names) for each in kept]
        if not function.__code__.co_filename.startswith(f"{_POSSE}{os.sep}"):
            scope = function.__globals__
            reached += [text, *((name, _digest(scope[name], names)) for name in read if name in scope)]
        _known[function] = _hash(function.__name__, reached)
    return _known[function]


@functools.cache
def _parts_of(code: CodeType) -> tuple[str, list[str], frozenset[str]]:
    """Return what code says, with functions inside it; the globals that it reads; and all names in it."""
    codes = [code]
    for each in codes:
        codes += (constant for constant in each.co_consts if isinstance(constant, CodeType))
    constants = [constant for each in codes for constant in each.co_consts if not isinstance(constant, CodeType)]
    text = repr(([(c.co_code, c.co_names, c.co_varnames, c.co_freevars) for c in codes], constants))
    steps = (step for each in codes for step in dis.get_instructions(each))
    read = {step.argval for step in steps if step.opname in ("LOAD_GLOBAL", "LOAD_NAME")}
    return text, sorted(read), frozenset(name for each in codes for name in each.co_names)


class _Cache(caching.NullCache):
    """The machine code of a kernel in files, each under a hash of all that it depends on."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    def _path(self, sig: Any, target: Any) -> Path:
        user = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
        folder = Path(os.environ.get("POSSE_CACHE_DIR") or Path(user).expanduser() / "posse").absolute()
        f = self._function
        return folder / f"{f.__name__}-{_hash(stamp(f, tuple(sig)), f.__module__, f.__qualname__, target).hex()}.kernel"

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        with contextlib.suppress(Exception):  # what cannot be read is compiled
            path = self._path(sig, target_context.codegen().magic_tuple())
            written = path.read_bytes()
            if written[:32] == _hash(path.name, written[32:]):  # numba would run flipped bits
                return compiler.CompileResult._rebuild(target_context, *pickle.loads(written[32:]))  # noqa: S301
        _announce()
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        if not data.library.has_dynamic_globals:  # addresses
            with contextlib.suppress(Exception):  # no room or permission: the next process compiles, too
                path, content = self._path(sig, data.codegen.magic_tuple()), serialize.dumps(data._reduce())
                path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
                unfinished = path.with_suffix(f".{os.getpid()}")
                unfinished.write_bytes(_hash(path.name, content) + content)
                unfinished.replace(path)


@functools.cache  # once per process
def _announce() -> None:
    again = "if it does so at every start, set POSSE_CACHE_DIR to a folder that can be written to"
    sys.stderr.write(f"posse: compiling kernels, which takes some seconds; {again}\n")


# numba's inner parts.


class _Library(codegen.JITCodeLibrary):
    """LLVM code of a kernel, in which only what is marked is inlined, and no loop is unrolled or vectorised.

    Most loops run a few times: this makes kernels 10 % faster, and saves 1.5 s of compiling.
    """

    def add_ir_module(self, ir_module: Any) -> None:
        for function in ir_module.functions:
            if function.blocks and "alwaysinline" not in function.attributes:
                function.attributes.add("noinline")
        super().add_ir_module(ir_module)

    def _optimize_final_module(self) -> None:
        options = binding.create_pipeline_tuning_options(_CONFIG.OPT)
        options.loop_unrolling = options.loop_vectorization = False
        builder = binding.create_pass_builder(self._codegen._tm, options)
        builder.getModulePassManager().run(self._final_module, builder)


class _InnerLibrary(_Library):
    """LLVM code of a function, which is optimised and made machine code only where it is linked; saves 12 s."""

    codegen: Any = SimpleNamespace(set_env=lambda name, environment: None)  # numba's requires machine code

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True


class _Compiler(compiler.CompilerBase):
    """numba's passes with the libraries above: the inner one for functions without a wrapper for Python."""

    def define_pipelines(self) -> list[Any]:
        state = self.state
        library = _InnerLibrary if state.flags.no_cpython_wrapper else _Library
        state.library = library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return [compiler.DefaultPassBuilder.define_nopython_pipeline(state)]


class _FunctionType(types.Dispatcher):
    """Type of a function without a value at run time: numba's own holds an address, which cannot be cached."""

    def get_call_type(self, context: Any, args: Any, kws: Any) -> Any:
        return super().get_call_type(context, tuple(map(types.unliteral, args)), kws)  # not once for each constant


extending.register_model(_FunctionType)(extending.models.OpaqueModel)
imputils.lower_constant(_FunctionType)(lambda context, builder, kind, function: context.get_dummy_value())


class _Function(CPUDispatcher):
    """A function that Python can call, with a form to link into kernels for each state of what it reaches."""

    def __init__(self, function: Callable[..., Any], out_of_line: bool) -> None:
        super().__init__(function, {}, _OPTIONS)
        wrappers = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        self.inner_options = {**_OPTIONS, **wrappers, "forceinline": not out_of_line}
        self.inner: dict[bytes, CPUDispatcher] = {}

    @property
    def _numba_type_(self) -> _FunctionType:
        state = _digest(self)
        if state not in self.inner:
            self.inner[state] = CPUDispatcher(self.py_func, {}, self.inner_options, _Compiler)
        return _FunctionType(self.inner[state])
