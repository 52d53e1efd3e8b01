"""The decorators that compile functions, and numba's options.

:func:`compiled` is for small functions of one robot or one world. :func:`kernel` is for the few
functions called from Python, each compiled together with everything that it calls and cached on
disk, so that only the first process after a change has to compile.

There is no fast-math, since a result must not depend on the position of a world in its batch.
With ``NUMBA_DISABLE_JIT=1`` both decorators return the plain function, for debugging.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator
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
    """Compile a function that is called by kernels and other compiled functions.

    ``@compiled`` inlines it into its callers, since passing arrays takes longer than most of these
    functions. ``@compiled(seldom=True)``, for long and rarely called functions, never inlines it,
    so that the hot path fits the instruction cache.
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


def kernel(function: F | None = None, *, sources: Iterable[Callable[..., Any]] = ()) -> F | Callable[[F], F]:
    """Compile a function that is called from Python, and cache the result on disk.

    The arrays passed to a kernel must not overlap: the compiler assumes that writing to one does
    not change another.

    A kernel is compiled again if any file of its package, or of the packages of the functions that
    it calls, or one of their constants changes. The cache directory is ``$POSSE_CACHE_DIR``, or
    ``posse`` in the user's cache directory; if it cannot be used, each process compiles and prints
    the reason.

    Args:
        function: The function.
        sources: Functions that it calls but that its globals and closure do not refer to, such as
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


@contextlib.contextmanager
def checked_before_compiling(function: Callable[..., Any], check: Callable[[], None]) -> Iterator[None]:
    """Call ``check`` if a kernel has to be compiled in this context, before it is; it may raise."""
    cache = getattr(function, "_cache", None)
    if not isinstance(cache, KernelCache):  # uncompiled
        yield
        return
    plain, cache.before_compiling = cache.before_compiling, check
    try:
        yield
    finally:
        cache.before_compiling = plain


def direct(function: F) -> F:
    """Return the machine code of a kernel, which does not check the types of its arguments.

    numba's dispatch looks up the type of every argument, which takes longer than a world's step.
    Callers must pass arguments of the types of the kernel's first call. A kernel that has not been
    called yet, or with several types, is returned unchanged. Uncompiled kernels are returned with
    numpy's overflow warnings off, since compiled code does not warn.
    """
    if UNCOMPILED:
        return np.errstate(over="ignore", under="ignore")(function)
    forms = list(getattr(function, "overloads", {}).values())
    return cast("F", forms[0].entry_point) if len(forms) == 1 else function
