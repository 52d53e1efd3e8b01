"""Compile functions to machine code, and keep kernels on disk.

:func:`compiled` is for functions of one robot or one world, :func:`kernel` for the few that are called from Python,
each compiled together with all that it calls. There is no fast-math, since a result must not depend on a world's
position in its batch. With ``NUMBA_DISABLE_JIT=1`` both return the plain function, for debugging.

Three of numba's inner parts are overridden; ``tests/envs/numeric/test_compile.py`` fails if a new numba lacks them.
What each gains, of 20 s until the first step with nothing cached, and in speed:

=================== ================================================================================================
``JITCodeLibrary``  functions are optimised only in the kernel, 12 s; no short loop is vectorised, 6 s and 5 % faster
``CPUDispatcher``   a function is compiled once for all integers, not for each constant, 7 s
``CompilerBase``    chooses the library, and says that arrays do not overlap (``noalias``), up to 7 % faster
=================== ================================================================================================
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import pickle
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Final, TypeVar, cast, overload

import numba
import numpy as np
from numba.core import types
from numba.core.caching import NullCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, CompileResult, DefaultPassBuilder
from numba.core.extending import models, register_model
from numba.core.imputils import lower_constant
from numba.core.registry import CPUDispatcher
from numba.core.serialize import dumps

import posse.numeric.lane_code  # noqa: F401 (registers lanes with numba)
from posse.numeric.stamp import describe, digest, stamp

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
def compiled(*, seldom: bool = ...) -> Callable[[F], F]: ...


def compiled(function: F | None = None, *, seldom: bool = False) -> F | Callable[[F], F]:
    """Compile a function that kernels and other compiled functions call.

    ``@compiled`` inlines it into its callers, since passing arrays takes longer than most functions.
    ``@compiled(seldom=True)`` never does: long and rarely called functions would crowd the instruction cache.
    """
    if function is None:
        return functools.partial(compiled, seldom=seldom)
    return function if UNCOMPILED else cast("F", _Function(function, {**_OPTIONS, "forceinline": not seldom}))


def kernel(function: F) -> F:
    """Compile a function that is called from Python; its arrays must not overlap.

    The machine code is kept in ``$POSSE_CACHE_DIR``, or ``posse`` in the user's cache directory. It is compiled again
    if a source of posse changes, or anything that a function from elsewhere reaches (:func:`stamp`).
    """
    if UNCOMPILED:
        return function
    dispatcher: Any = CPUDispatcher(function, {}, _OPTIONS, _KernelCompiler)
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


# The cache.


_KEPT: Final = 256  # files, of up to 1 MB


class _Cache(NullCache):
    """The machine code of a kernel in files, each under a hash of all that it depends on."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    def _path(self, sig: Any, target: Any) -> tuple[Path, bytes]:
        """Return the file for argument types and a processor, and the hash that it begins with."""
        f = self._function
        key = repr((stamp(f), f.__module__, f.__qualname__, describe(sig), target)).encode()
        name = hashlib.sha256(key)
        return _folder() / f"{f.__name__}-{name.hexdigest()[:32]}.kernel", name.digest()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        with contextlib.suppress(Exception):  # what cannot be read is compiled
            path, name = self._path(sig, target_context.codegen().magic_tuple())
            content = path.read_bytes()
            if content[:32] == hashlib.sha256(name + content[32:]).digest():  # numba would run flipped bits
                return CompileResult._rebuild(target_context, *pickle.loads(content[32:]))  # noqa: S301
        _announce()
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        if not data.library.has_dynamic_globals:  # addresses
            with contextlib.suppress(Exception):  # no room or permission: the next process compiles, too
                path, name = self._path(sig, data.codegen.magic_tuple())
                content = dumps(data._reduce())
                path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
                with tempfile.TemporaryDirectory(dir=path.parent) as unfinished:
                    Path(unfinished, "kernel").write_bytes(hashlib.sha256(name + content).digest() + content)
                    Path(unfinished, "kernel").replace(path)
                for old in sorted(path.parent.glob("*.kernel"), key=lambda each: each.stat().st_mtime)[:-_KEPT]:
                    old.unlink(missing_ok=True)


def _folder() -> Path:
    user = os.environ.get("XDG_CACHE_HOME")
    chosen = os.environ.get("POSSE_CACHE_DIR") or (Path(user) if user else Path.home() / ".cache") / "posse"
    return Path(chosen).absolute()


@functools.cache  # once per process
def _announce() -> None:
    kept = "in each process; set POSSE_CACHE_DIR to a directory that you can write to"
    with contextlib.suppress(OSError, RuntimeError):  # RuntimeError: no home
        _folder().mkdir(mode=0o700, parents=True, exist_ok=True)
        kept = f"once; cached in {_folder()}" if os.access(_folder(), os.W_OK) else kept
    sys.stderr.write(f"posse: compiling kernels, which takes some seconds ({kept})\n")


# numba's inner parts.


class _Library(JITCodeLibrary):
    """LLVM code in which only what is marked is inlined, and no short loop is vectorised."""

    def add_ir_module(self, ir_module: Any) -> None:
        for function in ir_module.functions:
            if function.blocks and "alwaysinline" not in function.attributes:
                function.attributes.add("noinline")
        super().add_ir_module(ir_module)

    def _optimize_final_module(self) -> None:
        passes, builder = self._codegen._module_pass_manager(loop_vectorize=False, slp_vectorize=True)
        passes.run(self._final_module, builder)


class _InnerLibrary(_Library):
    """LLVM code of one function, which is optimised only where it is linked."""

    codegen: Any = SimpleNamespace(set_env=lambda name, environment: None)  # numba's requires machine code

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True


class _KernelCompiler(CompilerBase):
    library: type[_Library] = _Library

    def define_pipelines(self) -> list[Any]:
        state = self.state
        state.flags.noalias = self.library is _Library
        state.library = self.library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return [DefaultPassBuilder.define_nopython_pipeline(state)]


class _InnerCompiler(_KernelCompiler):
    library = _InnerLibrary


class _FunctionType(types.Dispatcher):
    """Type of a function without a value at run time: numba's own holds an address, which cannot be cached."""


register_model(_FunctionType)(models.OpaqueModel)
lower_constant(_FunctionType)(lambda context, builder, kind, function: context.get_dummy_value())


class _Function(CPUDispatcher):
    """A function that Python can call, with a form to link into kernels for each state of what it reaches."""

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        super().__init__(function, {}, options)
        self.options = {**options, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        self.inner: dict[bytes, _Inner] = {}

    @property
    def _numba_type_(self) -> _FunctionType:
        state = digest(self)
        if state not in self.inner:
            self.inner[state] = _Inner(self.py_func, {}, self.options, _InnerCompiler)
        return _FunctionType(self.inner[state])


class _Inner(CPUDispatcher):
    def get_call_template(self, args: Any, kws: Any) -> Any:
        return super().get_call_template(tuple(map(_widest, args)), {name: _widest(kws[name]) for name in kws})


def _widest(kind: Any) -> Any:
    plain = types.unliteral(kind)
    return types.int64 if plain in (types.int32, types.uint8) else plain
