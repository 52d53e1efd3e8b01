"""Work that a compiler repeats without need."""

from __future__ import annotations

import contextlib
import gc
from collections.abc import Callable, Iterator
from typing import Any


@contextlib.contextmanager
def paused_collector() -> Iterator[None]:
    """Do not collect cyclic garbage; afterwards the collector is as it was before."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


@contextlib.contextmanager
def wrapped(owner: Any, method: str, wrap: Callable[[Any], Any]) -> Iterator[None]:
    """Replace a method of one object by what ``wrap`` makes of it."""
    setattr(owner, method, wrap(getattr(owner, method)))
    try:
        yield
    finally:
        delattr(owner, method)


def remembering(resolve: Callable[..., Any]) -> Callable[..., Any]:
    """Return numba's search for the signature of a call, which keeps what it has found."""
    found: dict[Any, Any] = {}

    def look_up(function: Any, args: Any, kws: Any) -> Any:
        if kws or isinstance(function, str):  # "static_getitem" takes values, not types
            return resolve(function, args, kws)
        key = function, tuple(args)
        return found[key] if key in found else found.setdefault(key, resolve(*key, kws))

    return look_up
