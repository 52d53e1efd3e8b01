"""How functions are compiled: the one place that knows numba's options.

Two decorators. :func:`compiled` is for the small scalar functions that say one thing about one
robot or one world. :func:`kernel` is for the few functions that Python calls, each of which
compiles everything below it: what it compiles to is kept on disk, so that only the first process
after a change waits for the compiler.

No fast-math, here or anywhere: a result must not depend on the place of a world in its batch.
With ``NUMBA_DISABLE_JIT=1`` both decorators return the plain function, for debugging.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, TypeVar, cast, overload

import numba
import numpy as np
from numba.core import types
from numba.core.extending import models, register_model
from numba.core.imputils import lower_constant
from numba.core.registry import CPUDispatcher

import posse.numeric.simd.lane_code  # noqa: F401 (so that numba knows lanes)
from posse.numeric.compiler.kernel_cache import (
    KernelCache,
    cache_directory,
    package_directory,
    package_stamp,
)
from posse.numeric.compiler.pipeline import Kernel, LinkedForm, ShortLoops

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

UNCOMPILED: Final = bool(numba.config.DISABLE_JIT)  # type: ignore[attr-defined]
"""Whether everything runs as plain Python."""


@overload
def compiled(function: F) -> F: ...


@overload
def compiled(*, seldom: bool = ...) -> Callable[[F], F]: ...


def compiled(function: F | None = None, *, seldom: bool = False) -> F | Callable[[F], F]:
    """Compile a function that kernels, and other compiled functions, call.

    Written as ``@compiled``: it becomes part of whatever calls it. Or as
    ``@compiled(seldom=True)`` for what is long and seldom run: it stays by itself, so that what
    runs in every step lies close together and fits the processor's cache of instructions. Types
    have to fit on both sides of a branch, even where a constant decides it.
    """

    def decorate(function: F) -> F:
        if UNCOMPILED:
            return function
        package_stamp(package_directory(function))
        return cast("F", _Function(function, inline=not seldom))

    return decorate if function is None else decorate(function)


class _Linked(CPUDispatcher):
    """The form for kernels to link, compiled once for all whole numbers that it is called with.

    numba would compile it anew for each constant and each width.
    """

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Return how to call it with arguments of these types (numba's name for it)."""
        return super().get_call_template(
            tuple(_widest(kind) for kind in args),
            {name: _widest(kind) for name, kind in kws.items()},
        )

    def compile(self, sig: Any) -> Any:
        """Compile it for arguments of these types, if that is still to do (numba's name for it).

        numba's own would also look on disk, and time itself: each of them and all within it.
        """
        if sig not in self.overloads:
            with self._compiling_counter:
                self.add_overload(self._compiler.compile(sig, None))  # type: ignore[attr-defined]
        return self.overloads[sig].entry_point  # type: ignore[attr-defined]


def _widest(kind: Any) -> Any:
    plain = types.unliteral(kind)  # type: ignore[no-untyped-call]
    return types.int64 if plain in (types.int32, types.uint8) else plain


class _FunctionType(types.Dispatcher):
    """A function as compiled code has it: a type, which says what to call, and no value.

    numba's own has the function's address for a value, which no cache could keep.
    """


register_model(_FunctionType)(models.OpaqueModel)


@lower_constant(_FunctionType)  # type: ignore[no-untyped-call, untyped-decorator]
def _lower_function(context: Any, builder: Any, kind: Any, function: Any) -> Any:
    return context.get_dummy_value()


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
        self._linked = _Linked(
            function,
            targetoptions={**options, **_LINKED, "forceinline": inline},
            pipeline_class=LinkedForm,
        )

    @property
    def _numba_type_(self) -> _FunctionType:
        """What compiled code takes this function for."""
        return _FunctionType(self._linked)


@overload
def kernel(function: F) -> F: ...


@overload
def kernel(*, short_loops: bool = ...) -> Callable[[F], F]: ...


def kernel(function: F | None = None, *, short_loops: bool = False) -> F | Callable[[F], F]:
    """Compile a function that Python calls, and keep the result on disk.

    Written as ``@kernel``, or as ``@kernel(short_loops=True)`` where the inner loops are short
    (over trackers, beams, places). Those are not vectorised as loops, since to find out at run
    time whether one is long enough takes longer than the loop; a loop of fixed length (over a
    block of eight, say) is unrolled instead, and its turns are done at once. The arrays that such a
    kernel is given must not overlap: what it reads from one it then need not read again after it
    has written to another.

    The directory is ``$POSSE_CACHE_DIR``, or ``posse`` in the user's cache directory. Where it
    cannot be written, and for functions outside a package (a script, a notebook), every process
    compiles for itself.
    """

    def decorate(function: F) -> F:
        if UNCOMPILED:
            return function
        package = package_directory(function)
        package_stamp(package)
        form = ShortLoops if short_loops else Kernel
        dispatcher = numba.njit(**_OPTIONS, pipeline_class=form)(function)
        if package is not None and cache_directory() is not None:
            dispatcher._cache = KernelCache(function)  # type: ignore[no-untyped-call]
        return cast("F", dispatcher)

    return decorate if function is None else decorate(function)


def direct(function: F) -> F:
    """Return a kernel's compiled form, which takes its arguments for what they were the first time.

    numba's own call looks up the type of every argument, which takes longer than a world's step.
    Whoever calls the compiled form has to pass arguments of just those types. Where a kernel has
    not been called yet, or has been with several types, it is returned as it is. Plain Python is
    kept from warning where compiled code would not.
    """
    if UNCOMPILED:
        return np.errstate(over="ignore", under="ignore")(function)
    forms = list(getattr(function, "overloads", {}).values())
    return cast("F", forms[0].entry_point) if len(forms) == 1 else function
