"""How a kernel takes numpy's arrays: where they lie, read from the array objects themselves.

numba asks a function of its own about each array, and counts its elements; with some twenty arrays
that is a quarter of what a call for one world takes. Here the few machine instructions that read
the same from the object become part of the call. Nothing is counted or checked: Python holds the
arrays while the kernel runs, and numba has looked at their types (or :func:`posse.compiled.direct`
was told them).
"""

from __future__ import annotations

from typing import Any, Final

from llvmlite import ir
from numba.core import cgutils
from numba.core.pythonapi import NativeValue

_WORD: Final = ir.IntType(64)
_WORDS: Final = ir.PointerType(_WORD)

# The words of numpy's PyArrayObject_fields, after what every Python object begins with: its data,
# the number of its dimensions, and where its shape and its strides stand.
_HEAD: Final = object.__basicsize__ // 8
_DATA: Final = _HEAD
_SHAPE: Final = _HEAD + 2
_STRIDES: Final = _HEAD + 3


def take_array(kind: Any, array: Any, c: Any) -> NativeValue:
    """Emit code that takes an array as it lies (numba's unboxing of it)."""
    builder = c.builder

    def word(words: Any, number: int) -> Any:
        return builder.load(builder.gep(words, [ir.Constant(_WORD, number)]))

    def row(number: int) -> list[Any]:
        words = builder.inttoptr(word(fields, number), _WORDS)
        return [word(words, k) for k in range(kind.ndim)]

    fields = builder.bitcast(array, _WORDS)
    taken = c.context.make_array(kind)(c.context, builder)
    shape, element = row(_SHAPE), c.context.get_data_type(kind.dtype)
    count = ir.Constant(_WORD, 1)
    for length in shape:
        count = builder.mul(count, length)
    taken.meminfo = cgutils.get_null_value(taken.meminfo.type)
    taken.parent = cgutils.get_null_value(taken.parent.type)
    taken.nitems = count
    taken.itemsize = ir.Constant(_WORD, c.context.get_abi_sizeof(element))
    taken.data = builder.inttoptr(word(fields, _DATA), taken.data.type)
    taken.shape = cgutils.pack_array(builder, shape)
    taken.strides = cgutils.pack_array(builder, row(_STRIDES))
    return NativeValue(taken._getvalue())
