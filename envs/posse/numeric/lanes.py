"""Blocks of eight numbers (SIMD).

``Lanes`` are eight float32 values, a ``Mask`` eight booleans; compiled code holds each in a vector register. A formula
such as ``x * x + y * y`` is written as for single numbers and computes eight discs or beams in the time of one. A
float32 is broadcast to eight copies. Rounding is the same as for single numbers: a lane does not depend on its
neighbours.

Lanes support ``+ - * /``, ``abs`` and the comparisons ``< <= > >= == !=``, which return masks; masks support ``&``
and ``|``. All other operations are the functions below; ``choose``, ``lesser``, ``greater`` and ``root`` also accept
single numbers, so that a formula is written only once. The body of a function works on numpy arrays and is used only
if nothing is compiled; the decorators above it say what it compiles to.
"""

import operator
from collections.abc import Callable
from typing import Any, Final, TypeVar, get_type_hints

import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.extending import models, register_model
from numba.core.imputils import lower_builtin, lower_cast
from numba.core.typeconv.castgraph import Conversion
from numba.core.typing.templates import AbstractTemplate, ConcreteTemplate, infer_global, signature

from posse.numeric.arrays import FloatArray, Record

WIDTH: Final = 8
_PLACES: Final = np.arange(WIDTH)
ALL: Final = 2**WIDTH - 1
"""The :func:`bits` of a mask that is true everywhere."""

Lanes = Any
"""Eight float32."""
Mask = Any
"""Eight booleans."""

F = TypeVar("F", bound=Callable[..., Any])


class LanesType(types.Type):
    """numba's type of eight float32."""

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """Convert a number to eight copies of itself (numba's interface)."""
        if other == types.float32:
            return Conversion.safe
        return Conversion.unsafe if isinstance(other, (types.Float, types.Integer, types.Boolean)) else None


class MaskType(types.Type):
    """numba's type of eight truth values."""


_LANES, _MASK, _NUMBER = LanesType("Lanes"), MaskType("Mask"), types.float32
_FLOAT, _BYTE, _INDEX = ir.FloatType(), ir.IntType(8), ir.IntType(32)
_FLOATS, _BITS, _INTEGERS = (ir.VectorType(kind, WIDTH) for kind in (_FLOAT, ir.IntType(1), _INDEX))
register_model(LanesType)(lambda manager, kind: models.PrimitiveModel(manager, kind, _FLOATS))
register_model(MaskType)(lambda manager, kind: models.PrimitiveModel(manager, kind, _BITS))


def tuple_of_lanes(kind: type) -> types.NamedTuple:
    """Return numba's type of a named tuple whose fields are declared as Lanes, as Mask, or as such a tuple."""
    hints, fields = get_type_hints(kind), []
    for name, written in kind.__annotations__.items():  # names in forward references: both are Any among the hints
        single = _MASK if "Mask" in str(written) else _LANES
        fields.append(tuple_of_lanes(hints[name]) if hasattr(hints[name], "_fields") else single)
    return types.NamedTuple(fields, kind)


def _key(function: Callable[..., Any]) -> Any:
    """Return a function's key for numba: of those below a text, since they are not in their module when decorated."""
    return f"{__name__}.{function.__name__}" if function.__module__ == __name__ else function


def _emits(emit: Callable[..., Any], result: Any, *arguments: Any) -> Callable[[F], F]:
    """Declare a function or an operator to numba: its types, and what emits LLVM instructions for its arguments.

    If the first argument is a class, of arrays or records, any of that class will do; ``emit`` is given its address.
    """

    def declare(function: F) -> F:
        @infer_global(function, typing_key=_key(function))
        class Template(AbstractTemplate if isinstance(arguments[0], type) else ConcreteTemplate):  # type: ignore[misc]
            cases = (signature(result, *arguments),)

            def generic(self, args: Any, kws: Any) -> Any:
                return signature(result, args[0], *arguments[1:])

        @lower_builtin(_key(function), *arguments)
        def lower(context: Any, builder: Any, sig: Any, values: Any) -> Any:
            if arguments[0] is types.Array:
                values = context.make_array(sig.args[0])(context, builder, values[0]).data, *values[1:]
            found = emit(builder, *values)
            return context.get_dummy_value() if result is types.none else found

        return function

    return declare


def _compare(sign: str) -> Callable[..., Any]:
    """Return an emitter of a comparison; with nan only ``!=`` is true, as for single numbers."""
    emit = ir.IRBuilder.fcmp_unordered if sign == "!=" else ir.IRBuilder.fcmp_ordered
    return lambda builder, a, b: emit(builder, sign, a, b)


def _pick(sign: str) -> Callable[..., Any]:
    """Return an emitter that selects the second value where ``second <sign> first`` holds."""
    return lambda builder, a, b: builder.select(builder.fcmp_ordered(sign, b, a), b, a)


def _intrinsic(name: str) -> Callable[..., Any]:
    """Return an emitter that calls a function of LLVM on a number or on eight."""

    def emit(builder: Any, value: Any) -> Any:
        suffix = "f32" if value.type == _FLOAT else f"v{WIDTH}f32"
        kind = ir.FunctionType(value.type, [value.type])
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.{suffix}"), [value])

    return emit


_emits(_intrinsic("fabs"), _LANES, _LANES)(abs)
_emits(ir.IRBuilder.fneg, _LANES, _LANES)(operator.neg)
for _operator, _instruction in (
    (operator.add, ir.IRBuilder.fadd),
    (operator.sub, ir.IRBuilder.fsub),
    (operator.mul, ir.IRBuilder.fmul),
    (operator.truediv, ir.IRBuilder.fdiv),
):
    _emits(_instruction, _LANES, _LANES, _LANES)(_operator)
for _name, _sign in {"lt": "<", "le": "<=", "gt": ">", "ge": ">=", "eq": "==", "ne": "!="}.items():
    _emits(_compare(_sign), _MASK, _LANES, _LANES)(getattr(operator, _name))
_emits(ir.IRBuilder.and_, _MASK, _MASK, _MASK)(operator.and_)
_emits(ir.IRBuilder.or_, _MASK, _MASK, _MASK)(operator.or_)


def _spread(builder: Any, value: Any) -> Any:
    nothing = ir.Constant(ir.VectorType(value.type, WIDTH), ir.Undefined)
    return _shuffle(builder, builder.insert_element(nothing, value, ir.Constant(_INDEX, 0)), nothing, [0] * WIDTH)


def _shuffle(builder: Any, value: Any, other: Any, places: list[int]) -> Any:
    return builder.shuffle_vector(value, other, ir.Constant(_INTEGERS, places))


@lower_cast(types.Boolean, LanesType)
@lower_cast(types.Float, LanesType)
@lower_cast(types.Integer, LanesType)
def _cast(context: Any, builder: Any, fromty: Any, toty: Any, value: Any) -> Any:
    return _spread(builder, context.cast(builder, value, fromty, _NUMBER))


@_emits(_spread, _LANES, _NUMBER)
def eight(value: np.float32) -> Lanes:
    """Return eight copies of a number, for instance as the initial value of a loop variable."""
    return np.full(WIDTH, value, np.float32)


# The lowest decorator is applied first: numba takes the first declaration that fits, and a number may become eight.


@_emits(ir.IRBuilder.select, _LANES, _MASK, _LANES, _LANES)
@_emits(ir.IRBuilder.select, _NUMBER, types.boolean, _NUMBER, _NUMBER)
def choose(mask: Mask, value: Lanes, other: Lanes) -> Lanes:
    """Return ``value`` where the mask is true, else ``other``; both are always evaluated."""
    return np.asarray(np.where(mask, value, other))[()]


@_emits(_pick("<"), _LANES, _LANES, _LANES)
@_emits(_pick("<"), _NUMBER, _NUMBER, _NUMBER)
def lesser(value: Lanes, other: Lanes) -> Lanes:
    """Return the lesser, lane by lane."""
    return np.asarray(np.where(other < value, other, value))[()]


@_emits(_pick(">"), _LANES, _LANES, _LANES)
@_emits(_pick(">"), _NUMBER, _NUMBER, _NUMBER)
def greater(value: Lanes, other: Lanes) -> Lanes:
    """Return the greater, lane by lane."""
    return np.asarray(np.where(other > value, other, value))[()]


@_emits(_intrinsic("sqrt"), _LANES, _LANES)
@_emits(_intrinsic("sqrt"), _NUMBER, _NUMBER)
def root(value: Lanes) -> Lanes:
    """Return the square roots."""
    return np.sqrt(value)


def _emit_least(builder: Any, value: Any) -> Any:
    for size in (4, 2, 1):  # upper half onto the lower half
        places = [(k + size) % WIDTH for k in range(WIDTH)]
        value = _pick("<")(builder, value, _shuffle(builder, value, value, places))
    return builder.extract_element(value, ir.Constant(_INDEX, 0))


@_emits(_emit_least, _NUMBER, _LANES)
def least(value: Lanes) -> np.float32:
    """Return the least of eight numbers."""
    return np.float32(np.min(value))


@_emits(lambda b, value: b.sitofp(b.bitcast(value, _INTEGERS), _FLOATS), _LANES, _LANES)
def from_int(value: Lanes) -> Lanes:
    """Return int32 values, loaded from a record as raw bits, converted to float32."""
    return np.asarray(value, np.float32).view(np.int32).astype(np.float32)


@_emits(lambda b, mask: b.zext(b.bitcast(mask, ir.IntType(WIDTH)), ir.IntType(64)), types.intp, _MASK)
def bits(mask: Mask) -> int:
    """Return the mask as an integer; bit k is lane k."""
    return sum(1 << k for k, true in enumerate(np.broadcast_to(mask, WIDTH)) if true)


@_emits(lambda b, number: b.cttz(number, ir.Constant(ir.IntType(1), 1)), types.intp, types.intp)  # undefined for 0
def lowest_bit(number: int) -> int:
    """Return the index of the lowest set bit of a number other than 0."""
    whole = int(number)
    return (whole & -whole).bit_length() - 1


def _emit_transpose(builder: Any, block: Any) -> Any:
    """Swap blocks of 1, 2x2 and 4x4 numbers across the diagonal in three rounds."""
    rows = cgutils.unpack_tuple(builder, block, WIDTH)
    for size in (1, 2, 4):
        upper = [k if k & size == 0 else k - size + WIDTH for k in range(WIDTH)]
        lower = [k + size if k & size == 0 else k + WIDTH for k in range(WIDTH)]
        rows = [
            _shuffle(builder, rows[k & ~size], rows[k | size], upper if k & size == 0 else lower) for k in range(WIDTH)
        ]
    return cgutils.pack_array(builder, rows, _FLOATS)


@_emits(_emit_transpose, types.UniTuple(_LANES, WIDTH), types.UniTuple(_LANES, WIDTH))
def transpose(rows: tuple[Lanes, ...]) -> tuple[Lanes, ...]:
    """Return the transposed 8 x 8 matrix: the first lanes of all, the second lanes of all, ..."""
    return tuple(np.array([np.broadcast_to(row, WIDTH) for row in rows], np.float32).T)


def _eight_at(builder: Any, memory: Any, place: Any, unit: Any = _FLOAT) -> Any:
    """Return the address of eight numbers, so many units into memory."""
    return builder.bitcast(builder.gep(builder.bitcast(memory, unit.as_pointer()), [place]), _FLOATS.as_pointer())


def _prefetch(builder: Any, memory: Any, offset: Any) -> Any:
    address = builder.gep(builder.bitcast(memory, _BYTE.as_pointer()), [offset])
    kind = ir.FunctionType(ir.VoidType(), [address.type, _INDEX, _INDEX, _INDEX])
    function = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0i8")
    to_write, near, of_data = (ir.Constant(_INDEX, number) for number in (1, 3, 1))
    return builder.call(function, [address, to_write, near, of_data])


@_emits(lambda b, array, k: b.load(_eight_at(b, array, k), align=4), _LANES, types.Array, types.intp)
def load(array: FloatArray, index: int) -> Lanes:
    """Return the eight numbers from ``index`` on, which must not be negative."""
    return array[index + _PLACES]


@_emits(lambda b, array, k, x: b.store(x, _eight_at(b, array, k), align=4), types.none, types.Array, types.intp, _LANES)
def store(array: FloatArray, index: int, value: Lanes) -> None:
    """Write eight numbers from ``index`` on."""
    array[index + _PLACES] = value


@_emits(_prefetch, types.none, types.Array, types.intp)
def fetch(array: npt.NDArray[Any], offset: int) -> None:
    """Prefetch the cache line ``offset`` bytes into an array, for writing; no other effect."""


@_emits(lambda b, record, k: b.load(_eight_at(b, record, k, _BYTE), align=4), _LANES, types.Record, types.intp)
def load_fields(record: Record, offset: int) -> Lanes:
    """Return the eight float32 from ``offset`` bytes into a record on."""
    return np.frombuffer(record.tobytes(), np.float32, WIDTH, offset)
