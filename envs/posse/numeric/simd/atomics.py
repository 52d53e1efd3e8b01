"""Atomic operations on memory shared by threads, for compiled code."""

from __future__ import annotations

from typing import Any

from numba.core import types
from numba.extending import intrinsic


def _first(context: Any, builder: Any, sig: Any, values: Any) -> Any:
    return context.make_array(sig.args[0])(context, builder, values[0]).data


def _add(typing: Any, array: Any, value: Any) -> Any:
    """Atomically add to the first element of an array; return its previous value."""
    return types.int64(array, types.int64), lambda context, builder, sig, values: builder.atomic_rmw(
        "add", _first(context, builder, sig, values), values[1], "seq_cst"
    )


def _read(typing: Any, array: Any) -> Any:
    """Read the first element of an array from memory, which another thread may have written."""
    return types.int64(array), lambda context, builder, sig, values: builder.load_atomic(
        _first(context, builder, sig, values), "acquire", 8
    )


add: Any = intrinsic(_add)
read: Any = intrinsic(_read)
