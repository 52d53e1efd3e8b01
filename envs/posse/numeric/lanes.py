"""Blocks of eight numbers (SIMD).

``Lanes`` are eight float32 values, a ``Mask`` eight booleans; compiled code holds each in a vector
register. A formula such as ``x * x + y * y`` is written as for single numbers and computes eight
discs or beams in the time of one. A float32 is broadcast to eight copies. Rounding is the same as
for single numbers: a lane does not depend on its neighbours.

Lanes support ``+ - * /``, ``abs`` and the comparisons ``< <= > >= ==``, which return masks; masks
support ``&`` and ``|``. All other operations are the functions below; ``choose``, ``lesser``,
``greater`` and ``root`` also accept single numbers, so that a formula is written only once. The
function bodies work on numpy arrays and are used only if nothing is compiled;
:mod:`posse.numeric.lane_code` defines what they compile to.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse.numeric.arrays import FloatArray, Record

WIDTH: Final = 8

Lanes = Any
"""Eight float32."""
Mask = Any
"""Eight booleans."""


def load(array: FloatArray, index: int) -> Lanes:
    """Return the eight numbers from ``index`` on, which must not be negative."""
    return np.array([array[index + k] for k in range(WIDTH)], np.float32)


def store(array: FloatArray, index: int, value: Lanes) -> None:
    """Write eight numbers from ``index`` on."""
    for k, number in enumerate(np.broadcast_to(value, WIDTH)):
        array[index + k] = number


def fetch(array: npt.NDArray[Any], offset: int) -> None:
    """Prefetch the cache line ``offset`` bytes into an array, for writing; no other effect."""


def eight(value: np.float32) -> Lanes:
    """Return eight copies of a number, for instance as the initial value of a loop variable."""
    return np.full(WIDTH, value, np.float32)


def choose(mask: Mask, value: Lanes, other: Lanes) -> Lanes:
    """Return ``value`` where the mask is true, else ``other``; both are always evaluated."""
    return np.asarray(np.where(mask, value, other))[()]


def lesser(value: Lanes, other: Lanes) -> Lanes:
    """Return the lesser, lane by lane."""
    return np.asarray(np.where(other < value, other, value))[()]


def greater(value: Lanes, other: Lanes) -> Lanes:
    """Return the greater, lane by lane."""
    return np.asarray(np.where(other > value, other, value))[()]


def root(value: Lanes) -> Lanes:
    """Return the square roots."""
    return np.sqrt(value)


def least(value: Lanes) -> np.float32:
    """Return the least of eight numbers."""
    return np.float32(np.min(value))


def tagged(value: Lanes, number: int) -> Lanes:
    """Return non-negative numbers with their last six bits replaced by a tag below 64.

    The order of numbers that differ by more than 1/65,536 relatively is kept; :func:`tag` reads
    the tag.
    """
    whole = np.asarray(value, np.float32).view(np.uint32)
    return (whole & np.uint32(0xFFFFFFC0) | np.uint32(number)).view(np.float32)


def tag(value: Lanes) -> Lanes:
    """Return the tags set by :func:`tagged`, as float32."""
    return (np.asarray(value, np.float32).view(np.uint32) & np.uint32(63)).astype(np.float32)


def counts(value: Lanes) -> Lanes:
    """Return int32 values, loaded from a record as raw bits, converted to float32."""
    return np.asarray(value, np.float32).view(np.int32).astype(np.float32)


def bits(mask: Mask) -> int:
    """Return the mask as an integer; bit k is lane k."""
    return sum(1 << k for k, true in enumerate(np.broadcast_to(mask, WIDTH)) if true)


def lowest_bit(number: int) -> int:
    """Return the index of the lowest set bit of a number other than 0."""
    whole = int(number)
    return (whole & -whole).bit_length() - 1


def load_fields(record: Record, offset: int) -> Lanes:
    """Return the eight float32 from ``offset`` bytes into a record on."""
    return np.frombuffer(record.tobytes(), np.float32, WIDTH, offset)


def store_fields(record: Record, offset: int, value: Lanes) -> None:
    """Write eight float32 from ``offset`` bytes into a record on.

    Lanes over fields of other types must hold what :func:`load_fields` returned.
    """
    for name, (kind, at, *_) in record.dtype.fields.items():
        if kind.names is not None:  # a record within it
            store_fields(record[name], offset - at, value)
        elif kind == np.float32 and offset <= at < offset + 4 * WIDTH:
            record[name] = value[(at - offset) // 4]


def transpose(
    a: Lanes, b: Lanes, c: Lanes, d: Lanes, e: Lanes, f: Lanes, g: Lanes, h: Lanes
) -> tuple[Lanes, Lanes, Lanes, Lanes, Lanes, Lanes, Lanes, Lanes]:
    """Return the transposed 8 x 8 matrix: the first lanes of all, the second lanes of all, ..."""
    first, second, third, fourth, fifth, sixth, seventh, eighth = np.array(
        [np.broadcast_to(v, WIDTH) for v in (a, b, c, d, e, f, g, h)], np.float32
    ).T
    return first, second, third, fourth, fifth, sixth, seventh, eighth
