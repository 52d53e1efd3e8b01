"""Eight numbers that the processor works on at once.

``Lanes`` are eight float32, a ``Mask`` eight truth values; compiled code holds each in a vector
register. A formula that is written for a number, ``x * x + y * y``, then holds for eight discs or
beams, in the time of one. A float32 stands for eight of itself. Nothing is rounded otherwise than
for a number alone: a lane does not depend on its neighbours.

Lanes know ``+ - * /``, ``abs`` and ``< <= > >= ==``, which give masks; masks know ``&`` and ``|``.
The functions below are what else there is; ``choose``, ``lesser``, ``greater`` and ``root`` take
plain numbers, too, so that a formula need not be written twice. The bodies here are for where
nothing is compiled, and work on numpy arrays; :mod:`posse.numeric.simd.lane_code` says what they
compile to.
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
"""Eight truth values."""


def load(array: FloatArray, index: int) -> Lanes:
    """Return the eight numbers that begin at ``index``, which is not negative."""
    return np.array([array[index + k] for k in range(WIDTH)], np.float32)


def store(array: FloatArray, index: int, value: Lanes) -> None:
    """Write eight numbers from ``index`` on."""
    for k, number in enumerate(np.broadcast_to(value, WIDTH)):
        array[index + k] = number


def fetch(array: npt.NDArray[Any], offset: int) -> None:
    """Have the processor bring what lies so many bytes into an array into its cache.

    To be written soon: nothing else follows from it.
    """


def eight(value: np.float32) -> Lanes:
    """Return eight of a number: to begin with, where lanes are to be gathered in a loop."""
    return np.full(WIDTH, value, np.float32)


def choose(mask: Mask, value: Lanes, other: Lanes) -> Lanes:
    """Return ``value`` where the mask is true, else ``other``; both are worked out everywhere."""
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
    """Return numbers that are not negative with a number below 64 in place of their last six bits.

    They compare as before where they differ by more than a 65,536th, and say whose they are
    (:func:`tag`).
    """
    whole = np.asarray(value, np.float32).view(np.uint32)
    return (whole & np.uint32(0xFFFFFFC0) | np.uint32(number)).view(np.float32)


def tag(value: Lanes) -> Lanes:
    """Return the numbers that :func:`tagged` put in."""
    return (np.asarray(value, np.float32).view(np.uint32) & np.uint32(63)).astype(np.float32)


def counts(value: Lanes) -> Lanes:
    """Return whole numbers, int32 that were loaded as they stand in a record, as float32."""
    return np.asarray(value, np.float32).view(np.int32).astype(np.float32)


def bits(mask: Mask) -> int:
    """Return the mask as a number: its lowest bit is the first lane, its eighth the last."""
    return sum(1 << k for k, true in enumerate(np.broadcast_to(mask, WIDTH)) if true)


def lowest_bit(number: int) -> int:
    """Return the place of the lowest bit that is set in a number other than 0."""
    whole = int(number)
    return (whole & -whole).bit_length() - 1


def load_fields(record: Record, offset: int) -> Lanes:
    """Return the eight float32 that begin ``offset`` bytes into a record."""
    return np.frombuffer(record.tobytes(), np.float32, WIDTH, offset)


def store_fields(record: Record, offset: int, value: Lanes) -> None:
    """Write eight float32 from ``offset`` bytes into a record on.

    What is no float32 there has to be given back as :func:`load_fields` returned it.
    """
    for name, (kind, at, *_) in record.dtype.fields.items():
        if kind == np.float32 and offset <= at < offset + 4 * WIDTH:
            record[name] = value[(at - offset) // 4]


def transpose(
    a: Lanes, b: Lanes, c: Lanes, d: Lanes, e: Lanes, f: Lanes, g: Lanes, h: Lanes
) -> tuple[Lanes, Lanes, Lanes, Lanes, Lanes, Lanes, Lanes, Lanes]:
    """Return the first of all, the second of all, and so on."""
    first, second, third, fourth, fifth, sixth, seventh, eighth = np.array(
        [np.broadcast_to(v, WIDTH) for v in (a, b, c, d, e, f, g, h)], np.float32
    ).T
    return first, second, third, fourth, fifth, sixth, seventh, eighth
