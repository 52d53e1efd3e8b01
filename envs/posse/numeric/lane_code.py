"""Compilation of :mod:`posse.numeric.lanes` to LLVM vectors of eight."""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any, Final

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.extending import models, register_model
from numba.core.imputils import lower_builtin, lower_cast
from numba.core.typeconv.castgraph import Conversion
from numba.core.typing.templates import AbstractTemplate, ConcreteTemplate, infer_global, signature

from posse.numeric.lanes import (
    WIDTH,
    bits,
    choose,
    counts,
    eight,
    fetch,
    greater,
    least,
    lesser,
    load,
    load_fields,
    lowest_bit,
    root,
    store,
    store_fields,
    tag,
    tagged,
    transpose,
)

_FLOATS: Final = ir.VectorType(ir.FloatType(), WIDTH)
_BITS: Final = ir.VectorType(ir.IntType(1), WIDTH)
_INTEGERS: Final = ir.VectorType(ir.IntType(32), WIDTH)


class LanesType(types.Type):
    """numba's type of eight float32."""

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """Convert a number to eight copies of itself (numba's interface)."""
        if other == types.float32:
            return Conversion.safe
        return Conversion.unsafe if isinstance(other, (types.Float, types.Integer)) else None


class MaskType(types.Type):
    """numba's type of eight truth values."""


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, of: Any) -> None:
        super().__init__(manager, of, _FLOATS)


@register_model(MaskType)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager: Any, of: Any) -> None:
        super().__init__(manager, of, _BITS)


_LANES: Final = LanesType("Lanes")
_MASK: Final = MaskType("Mask")


def tuple_of_lanes(kind: type) -> types.NamedTuple:
    """Return numba's type of a named tuple whose fields are declared as Lanes or Mask."""
    fields = kind.__annotations__.values()
    return types.NamedTuple([_MASK if each == "Mask" else _LANES for each in fields], kind)


def _spread(builder: Any, value: Any) -> Any:
    nothing = ir.Constant(ir.VectorType(value.type, WIDTH), ir.Undefined)
    first = builder.insert_element(nothing, value, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(first, nothing, ir.Constant(_INTEGERS, [0] * WIDTH))


@lower_cast(types.Float, LanesType)
@lower_cast(types.Integer, LanesType)
def _cast(context: Any, builder: Any, fromty: Any, toty: Any, value: Any) -> Any:
    return _spread(builder, context.cast(builder, value, fromty, types.float32))


def _declare(function: Any, result: Any, arguments: tuple[Any, ...], emit: Callable[..., Any]) -> None:
    """Declare the types and the instructions of a function or operator to numba."""

    @infer_global(function)
    class Template(ConcreteTemplate):
        cases = (signature(result, *arguments),)

    @lower_builtin(function, *arguments)
    def lower(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        return emit(builder, *values)


def _pick(sign: str) -> Callable[..., Any]:
    """Return an emitter that selects the second value where ``second <sign> first`` holds."""

    def emit(builder: Any, value: Any, other: Any) -> Any:
        return builder.select(builder.fcmp_ordered(sign, other, value), other, value)

    return emit


def _emit_absolute(builder: Any, value: Any) -> Any:
    kind = ir.FunctionType(value.type, [value.type])
    function = cgutils.get_or_insert_function(builder.module, kind, "llvm.fabs.v8f32")
    return builder.call(function, [value])


def _emit_root(builder: Any, value: Any) -> Any:
    name = "llvm.sqrt.f32" if value.type == ir.FloatType() else "llvm.sqrt.v8f32"
    kind = ir.FunctionType(value.type, [value.type])
    return builder.call(cgutils.get_or_insert_function(builder.module, kind, name), [value])


def _emit_tagged(builder: Any, value: Any, number: Any) -> Any:
    kept = builder.and_(builder.bitcast(value, _INTEGERS), ir.Constant(_INTEGERS, [~63] * WIDTH))
    put_in = _spread(builder, builder.trunc(number, ir.IntType(32)))
    return builder.bitcast(builder.or_(kept, put_in), _FLOATS)


def _emit_tag(builder: Any, value: Any) -> Any:
    tags = builder.and_(builder.bitcast(value, _INTEGERS), ir.Constant(_INTEGERS, [63] * WIDTH))
    return builder.sitofp(tags, _FLOATS)


def _emit_counts(builder: Any, value: Any) -> Any:
    return builder.sitofp(builder.bitcast(value, _INTEGERS), _FLOATS)


def _emit_least(builder: Any, value: Any) -> Any:
    lesser_of = _pick("<")
    for size in (4, 2, 1):  # upper half onto the lower half
        places = [(k + size) % WIDTH for k in range(WIDTH)]
        value = lesser_of(builder, value, _shuffle(builder, value, value, places))
    return builder.extract_element(value, ir.Constant(ir.IntType(32), 0))


def _emit_bits(builder: Any, mask: Any) -> Any:
    return builder.zext(builder.bitcast(mask, ir.IntType(WIDTH)), ir.IntType(64))


def _emit_lowest_bit(builder: Any, number: Any) -> Any:
    return builder.cttz(number, ir.Constant(ir.IntType(1), 1))  # undefined for 0


def _shuffle(builder: Any, value: Any, other: Any, places: list[int]) -> Any:
    return builder.shuffle_vector(value, other, ir.Constant(_INTEGERS, places))


def _emit_transpose(builder: Any, *rows: Any) -> Any:
    """Swap blocks of 1, 2x2 and 4x4 numbers across the diagonal in three rounds."""
    for size in (1, 2, 4):
        upper = [k if k & size == 0 else k - size + WIDTH for k in range(WIDTH)]
        lower = [k + size if k & size == 0 else k + WIDTH for k in range(WIDTH)]
        rows = tuple(
            _shuffle(builder, rows[k], rows[k + size], upper)
            if k & size == 0
            else _shuffle(builder, rows[k - size], rows[k], lower)
            for k in range(WIDTH)
        )
    return cgutils.pack_array(builder, rows, _FLOATS)


_TWO: Final = (_LANES, _LANES)
_declare(operator.add, _LANES, _TWO, lambda builder, a, b: builder.fadd(a, b))
_declare(operator.sub, _LANES, _TWO, lambda builder, a, b: builder.fsub(a, b))
_declare(operator.mul, _LANES, _TWO, lambda builder, a, b: builder.fmul(a, b))
_declare(operator.truediv, _LANES, _TWO, lambda builder, a, b: builder.fdiv(a, b))
_declare(operator.neg, _LANES, (_LANES,), lambda builder, a: builder.fneg(a))
_declare(abs, _LANES, (_LANES,), _emit_absolute)
_declare(operator.lt, _MASK, _TWO, lambda builder, a, b: builder.fcmp_ordered("<", a, b))
_declare(operator.le, _MASK, _TWO, lambda builder, a, b: builder.fcmp_ordered("<=", a, b))
_declare(operator.gt, _MASK, _TWO, lambda builder, a, b: builder.fcmp_ordered(">", a, b))
_declare(operator.ge, _MASK, _TWO, lambda builder, a, b: builder.fcmp_ordered(">=", a, b))
_declare(operator.eq, _MASK, _TWO, lambda builder, a, b: builder.fcmp_ordered("==", a, b))
_declare(operator.and_, _MASK, (_MASK, _MASK), lambda builder, a, b: builder.and_(a, b))
_declare(operator.or_, _MASK, (_MASK, _MASK), lambda builder, a, b: builder.or_(a, b))
_declare(eight, _LANES, (types.float32,), _spread)
_declare(transpose, types.UniTuple(_LANES, WIDTH), (_LANES,) * WIDTH, _emit_transpose)
_declare(tagged, _LANES, (_LANES, types.intp), _emit_tagged)
_declare(tag, _LANES, (_LANES,), _emit_tag)
_declare(counts, _LANES, (_LANES,), _emit_counts)
_declare(least, types.float32, (_LANES,), _emit_least)
_declare(bits, types.intp, (_MASK,), _emit_bits)
_declare(lowest_bit, types.intp, (types.intp,), _emit_lowest_bit)
for _number, _truth in ((types.float32, types.boolean), (_LANES, _MASK)):
    _both = (_number, _number)
    _declare(choose, _number, (_truth, *_both), lambda builder, m, a, b: builder.select(m, a, b))
    _declare(lesser, _number, _both, _pick("<"))
    _declare(greater, _number, _both, _pick(">"))
    _declare(root, _number, (_number,), _emit_root)


def _declare_memory(function: Any, kind: Any, result: Any, more: tuple[Any, ...], emit: Callable[..., Any]) -> None:
    """Declare a function whose first argument is any array or record; ``emit`` is given its address."""

    @infer_global(function)
    class Template(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            return signature(result, args[0], *more)

    @lower_builtin(function, kind, *more)
    def lower(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        array = kind is types.Array
        address = context.make_array(sig.args[0])(context, builder, values[0]).data if array else values[0]
        value = emit(builder, address, *values[1:])
        return context.get_dummy_value() if result is types.none else value


def _bytes(builder: Any, address: Any, offset: Any) -> Any:
    return builder.gep(builder.bitcast(address, ir.IntType(8).as_pointer()), [offset])


def _emit_load(builder: Any, address: Any) -> Any:
    return builder.load(builder.bitcast(address, _FLOATS.as_pointer()), align=4)


def _emit_store(builder: Any, address: Any, value: Any) -> Any:
    return builder.store(value, builder.bitcast(address, _FLOATS.as_pointer()), align=4)


def _emit_fetch(builder: Any, address: Any, offset: Any) -> Any:
    place, whole = _bytes(builder, address, offset), ir.IntType(32)
    kind = ir.FunctionType(ir.VoidType(), [place.type, whole, whole, whole])
    to_write, near, of_data = (ir.Constant(whole, number) for number in (1, 3, 1))
    function = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0i8")
    return builder.call(function, [place, to_write, near, of_data])


_AT: Final = (types.intp,)
_declare_memory(load, types.Array, _LANES, _AT, lambda b, array, k: _emit_load(b, b.gep(array, [k])))
_declare_memory(
    store, types.Array, types.none, (*_AT, _LANES), lambda b, array, k, v: _emit_store(b, b.gep(array, [k]), v)
)
_declare_memory(fetch, types.Array, types.none, _AT, _emit_fetch)
_declare_memory(load_fields, types.Record, _LANES, _AT, lambda b, record, k: _emit_load(b, _bytes(b, record, k)))
_declare_memory(
    store_fields,
    types.Record,
    types.none,
    (*_AT, _LANES),
    lambda b, record, k, v: _emit_store(b, _bytes(b, record, k), v),
)
