"""numba's interface to a cache, over kernels on disk: a warm start takes 0.6 s.

numba's own cache goes stale, since it knows one source file of a kernel, and reads damaged files.
"""

from __future__ import annotations

import contextlib
import functools
import pickle
from collections.abc import Callable
from typing import Any

from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from posse.numeric.compiler import kernel_files
from posse.numeric.compiler.stamps import Stamp


class KernelCache(NullCache):
    """Cache in which numba looks a kernel up before compiling, and stores it afterwards."""

    def __init__(self, *stamped: Any) -> None:
        self._stamped = stamped
        self.before_compiling: Callable[[], None] = lambda: None

    @functools.cached_property
    def _stamp(self) -> Stamp:
        return Stamp(*self._stamped)  # lazily: a kernel may call functions defined below it

    def _name(self, sig: Any, codegen: Any) -> str:
        return self._stamp.hexdigest(str(sig), *map(str, codegen.magic_tuple()))

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return a kernel for these types, or None."""
        with contextlib.suppress(Exception):  # after any error, compile
            kept = kernel_files.read(self._name(sig, target_context.codegen()))
            signature, parts = pickle.loads(kept) if kept is not None else (None, ())  # noqa: S301
            if signature == sig:
                return CompileResult._rebuild(target_context, *parts)
        self.before_compiling()
        kernel_files.announce()
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store a kernel for these types."""
        with contextlib.suppress(Exception):
            if self._stamp.holds() and not data.library.has_dynamic_globals:
                kernel_files.write(self._name(sig, data.codegen), dumps((sig, data._reduce())))
