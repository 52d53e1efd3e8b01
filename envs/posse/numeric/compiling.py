"""How functions are compiled: the one place that knows numba's options.

Two decorators. :func:`compiled` is for the small scalar functions that say one thing about one
robot or one world. :func:`kernel` is for the few functions that Python calls, each of which
compiles everything below it: what it compiles to is kept on disk, so that only the first process
after a change waits for the compiler.

No fast-math, here or anywhere: a result must not depend on the place of a world in its batch.
With ``NUMBA_DISABLE_JIT=1`` both decorators return the plain function, for debugging.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Final, TypeVar, cast, overload

import numba
import numpy as np

import posse.numeric.simd.lane_code  # noqa: F401 (registers lanes with numba)
from posse.numeric.compiler.numba_overrides import CompiledFunction, KernelCache, KernelCompiler
from posse.numeric.compiler.stamps import remember

F = TypeVar("F", bound=Callable[..., Any])

# error_model="numpy": division by zero gives inf or nan, as in numpy, and no branch to raise from.
# nogil: other Python threads run while a batch is stepped.
# _nrt: no reference counts, so compiled code may not create arrays.
_OPTIONS: Final[dict[str, Any]] = {"nogil": True, "error_model": "numpy", "_nrt": False}

UNCOMPILED: Final = bool(numba.config.DISABLE_JIT)  # type: ignore[attr-defined]
"""Whether everything runs as plain Python."""


@overload
def compiled(function: F) -> F: ...


@overload
def compiled(*, seldom: bool = ...) -> Callable[[F], F]: ...


def compiled(function: F | None = None, *, seldom: bool = False) -> F | Callable[[F], F]:
    """Compile a function that kernels, and other compiled functions, call.

    Written as ``@compiled``, it is inlined into whatever calls it: to pass arrays costs more than
    most of our functions take. Written as ``@compiled(seldom=True)``, for what is long and rarely
    called, it is never inlined, so that the hot path fits the instruction cache.
    """

    def decorate(function: F) -> F:
        if UNCOMPILED:
            return function
        remember(function)
        options = {**_OPTIONS, "nopython": True, "boundscheck": None, "forceinline": not seldom}
        return cast("F", CompiledFunction(function, options))

    return decorate if function is None else decorate(function)


@overload
def kernel(function: F) -> F: ...


@overload
def kernel(*, sources: Iterable[Callable[..., Any]] = ...) -> Callable[[F], F]: ...


def kernel(
    function: F | None = None, *, sources: Iterable[Callable[..., Any]] = ()
) -> F | Callable[[F], F]:
    """Compile a function that Python calls, and keep the result on disk.

    The arrays that a kernel is given must not overlap: what it has read from one, it does not read
    again after it wrote to another.

    It is compiled again when a file of a package changes that it, or a function that it calls,
    stands in, or a constant of theirs. The directory is ``$POSSE_CACHE_DIR``, or ``posse`` in the
    user's cache directory; where it cannot be used, every process compiles anew, and says why.

    Args:
        function: The function.
        sources: Functions that it calls, but that neither its globals nor its closure lead to, as
            those of a registry.
    """

    def decorate(function: F) -> F:
        if UNCOMPILED:
            return function
        remember(function)
        dispatcher = numba.njit(**_OPTIONS, pipeline_class=KernelCompiler)(function)
        dispatcher._cache = KernelCache(function, tuple(sources))
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
