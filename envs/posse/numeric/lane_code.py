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

from posse.numeric import lanes
from posse.numeric.lanes import WIDTH

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
    return lambda builder, a, b: builder.select(builder.fcmp_ordered(sign, b, a), b, a)


def _compare(sign: str) -> Callable[..., Any]:
    return lambda builder, a, b: builder.fcmp_ordered(sign, a, b)


def _intrinsic(name: str) -> Callable[..., Any]:
    """Return an emitter that calls a function of LLVM on a number or on eight."""

    def emit(builder: Any, value: Any) -> Any:
        suffix = "f32" if value.type == ir.FloatType() else f"v{WIDTH}f32"
        kind = ir.FunctionType(value.type, [value.type])
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.{suffix}"), [value])

    return emit


def _shuffle(builder: Any, value: Any, other: Any, places: list[int]) -> Any:
    return builder.shuffle_vector(value, other, ir.Constant(_INTEGERS, places))


def _emit_least(builder: Any, value: Any) -> Any:
    for size in (4, 2, 1):  # upper half onto the lower half
        places = [(k + size) % WIDTH for k in range(WIDTH)]
        value = _pick("<")(builder, value, _shuffle(builder, value, value, places))
    return builder.extract_element(value, ir.Constant(ir.IntType(32), 0))


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


_IR: Final = ir.IRBuilder
_ONE, _TWO, _NUMBER, _NUMBERS = (_LANES,), (_LANES, _LANES), (types.float32,), (types.float32, types.float32)
_OPERATIONS: Final[tuple[tuple[Any, Any, tuple[Any, ...], Callable[..., Any]], ...]] = (
    (operator.add, _LANES, _TWO, _IR.fadd),
    (operator.sub, _LANES, _TWO, _IR.fsub),
    (operator.mul, _LANES, _TWO, _IR.fmul),
    (operator.truediv, _LANES, _TWO, _IR.fdiv),
    (operator.neg, _LANES, _ONE, _IR.fneg),
    (abs, _LANES, _ONE, _intrinsic("fabs")),
    (operator.lt, _MASK, _TWO, _compare("<")),
    (operator.le, _MASK, _TWO, _compare("<=")),
    (operator.gt, _MASK, _TWO, _compare(">")),
    (operator.ge, _MASK, _TWO, _compare(">=")),
    (operator.eq, _MASK, _TWO, _compare("==")),
    (operator.and_, _MASK, (_MASK, _MASK), _IR.and_),
    (operator.or_, _MASK, (_MASK, _MASK), _IR.or_),
    # Of numbers first: numba takes the first that fits, and a number may become eight.
    (lanes.choose, types.float32, (types.boolean, *_NUMBERS), _IR.select),
    (lanes.choose, _LANES, (_MASK, *_TWO), _IR.select),
    (lanes.lesser, types.float32, _NUMBERS, _pick("<")),
    (lanes.lesser, _LANES, _TWO, _pick("<")),
    (lanes.greater, types.float32, _NUMBERS, _pick(">")),
    (lanes.greater, _LANES, _TWO, _pick(">")),
    (lanes.root, types.float32, _NUMBER, _intrinsic("sqrt")),
    (lanes.root, _LANES, _ONE, _intrinsic("sqrt")),
    (lanes.eight, _LANES, _NUMBER, _spread),
    (lanes.transpose, types.UniTuple(_LANES, WIDTH), (_LANES,) * WIDTH, _emit_transpose),
    (lanes.counts, _LANES, _ONE, lambda b, value: b.sitofp(b.bitcast(value, _INTEGERS), _FLOATS)),
    (lanes.least, types.float32, _ONE, _emit_least),
    (lanes.bits, types.intp, (_MASK,), lambda b, mask: b.zext(b.bitcast(mask, ir.IntType(WIDTH)), ir.IntType(64))),
    # cttz is undefined for 0.
    (lanes.lowest_bit, types.intp, (types.intp,), lambda b, number: b.cttz(number, ir.Constant(ir.IntType(1), 1))),
)
for _operation in _OPERATIONS:
    _declare(*_operation)


def _declare_memory(function: Any, kind: Any, result: Any, more: tuple[Any, ...], emit: Callable[..., Any]) -> None:
    """Declare a function of any array or record and a place, in elements or bytes; ``emit`` is given the address."""

    @infer_global(function)
    class Template(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            return signature(result, args[0], types.intp, *more)

    @lower_builtin(function, kind, types.intp, *more)
    def lower(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        memory, place, *value = values
        if kind is types.Array:
            memory = context.make_array(sig.args[0])(context, builder, memory).data
        if kind is types.Record or function is lanes.fetch:
            memory = builder.bitcast(memory, ir.IntType(8).as_pointer())
        found = emit(builder, builder.gep(memory, [place]), *value)
        return context.get_dummy_value() if result is types.none else found


def _emit_load(builder: Any, address: Any) -> Any:
    return builder.load(builder.bitcast(address, _FLOATS.as_pointer()), align=4)


def _emit_store(builder: Any, address: Any, value: Any) -> Any:
    return builder.store(value, builder.bitcast(address, _FLOATS.as_pointer()), align=4)


def _emit_fetch(builder: Any, address: Any) -> Any:
    whole = ir.IntType(32)
    kind = ir.FunctionType(ir.VoidType(), [address.type, whole, whole, whole])
    to_write, near, of_data = (ir.Constant(whole, number) for number in (1, 3, 1))
    function = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0i8")
    return builder.call(function, [address, to_write, near, of_data])


_declare_memory(lanes.load, types.Array, _LANES, (), _emit_load)
_declare_memory(lanes.store, types.Array, types.none, _ONE, _emit_store)
_declare_memory(lanes.fetch, types.Array, types.none, (), _emit_fetch)
_declare_memory(lanes.load_fields, types.Record, _LANES, (), _emit_load)
_declare_memory(lanes.store_fields, types.Record, types.none, _ONE, _emit_store)
