"""Vectors of the plane as complex numbers, and angles.

Positions (m) and velocities (m/s) are complex numbers x + iy, a heading is the unit vector e^(iθ). Thus ``v * heading``
turns a vector from a robot's own axes (ahead, to the left) into the common ones, ``v * heading.conjugate()`` turns it
back. Angles (rad) are measured from the positive x-axis.
"""

import math
from typing import Final

from posse.numeric import compiled

_TURN: Final = 2.0 * math.pi


@compiled
def wrap(angle: float) -> float:
    """Return the same direction (rad) as an angle in (-π, π]."""
    return angle - _TURN * math.ceil((angle - math.pi) / _TURN)


@compiled
def clip(value: float, low: float, high: float) -> float:
    """Return ``value`` clipped to [low, high]."""
    return max(low, min(value, high))


@compiled
def dot(a: complex, b: complex) -> float:
    """Return the scalar product of two vectors."""
    return a.real * b.real + a.imag * b.imag


@compiled
def cross(a: complex, b: complex) -> float:
    """Return the vector product of two vectors: positive where b points to the left of a."""
    return a.real * b.imag - a.imag * b.real


@compiled
def length(v: complex) -> float:
    """Return the length of a vector.

    ``abs`` also handles lengths whose square overflows; it is several times slower.
    """
    return math.sqrt(v.real * v.real + v.imag * v.imag)


@compiled
def scaled(v: complex, factor: float) -> complex:
    """Return a vector times a number; compiled code would multiply by a complex number instead."""
    return complex(v.real * factor, v.imag * factor)


@compiled
def unit(v: complex) -> complex:
    """Return a vector's direction as a unit vector; of one that is nearly zero, a shorter one."""
    return scaled(v, 1.0 / max(length(v), 1e-6))


@compiled
def angle_of(v: complex) -> float:
    """Return the direction (rad) of a vector, in [-π, π]."""
    return math.atan2(v.imag, v.real)


@compiled
def vector(size: float, angle: float) -> complex:
    """Return the vector of a length and a direction (rad)."""
    return complex(size * math.cos(angle), size * math.sin(angle))
