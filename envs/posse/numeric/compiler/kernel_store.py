"""Kernels on disk, under a hash of their sources and of what else their machine code depends on."""

from __future__ import annotations

import contextlib
import functools
import pickle
from collections.abc import Callable, Iterable
from typing import Any

from posse.numeric.compiler import kernel_files
from posse.numeric.compiler.stamps import Stamp


class KernelStore:
    """The compiled forms of a kernel on disk.

    Args:
        function: The kernel.
        others: Functions that it calls but that its globals and closure do not refer to.
    """

    def __init__(self, function: Callable[..., Any], others: Iterable[Callable[..., Any]]) -> None:
        self._stamped = function, others
        self.before_compiling: Callable[[], None] = lambda: None

    @functools.cached_property
    def _stamp(self) -> Stamp:
        return Stamp(*self._stamped)  # lazily: a kernel may call functions defined below it

    def _name(self, signature: Any, target: Iterable[Any]) -> str:
        return self._stamp.hexdigest(str(signature), *map(str, target))

    def load(self, signature: Any, target: Iterable[Any], rebuild: Callable[..., Any]) -> Any:
        """Return the form for a signature, or None if it has to be compiled.

        Args:
            signature: numba's type of the kernel.
            target: What identifies the processor.
            rebuild: Function that makes a form of the stored parts.

        Raises:
            Exception: There is none, and ``before_compiling`` raised this.
        """
        with contextlib.suppress(Exception):  # after any error, compile
            kept = kernel_files.read(self._name(signature, target))
            found, parts = pickle.loads(kept) if kept is not None else (None, ())  # noqa: S301
            if found == signature:
                return rebuild(*parts)
        self.before_compiling()
        kernel_files.announce()
        return None

    def save(self, signature: Any, target: Iterable[Any], reduce: Callable[[], bytes]) -> None:
        """Store what ``reduce`` returns: the signature and the parts of the form, pickled."""
        with contextlib.suppress(Exception):
            if self._stamp.holds():
                kernel_files.write(self._name(signature, target), reduce())
