"""Unicycle motion, equations (2-1) to (2-3) of the paper, integrated exactly.

With constant (V, ω) a robot moves on a circular arc. Headings are stored as (cos θ, sin θ), so a
step needs no trigonometric function: the turn in a physics step is at most 1 rad (checked with the
scenario), for which a short polynomial is exact to float32 rounding.
"""

import math
from typing import Final

import numpy as np

from posse.numeric import HALF, ONE, ZERO, Lanes, compiled, greater, lesser

_THREE_HALVES: Final = np.float32(1.5)
_C6: Final = np.float32(1 / 6)
_C20: Final = np.float32(1 / 20)
_C42: Final = np.float32(1 / 42)
_C12: Final = np.float32(1 / 12)
_C30: Final = np.float32(1 / 30)
_C56: Final = np.float32(1 / 56)
_SMALL: Final = np.float32(5e-7)  # up to this, tan(x) = x within rounding
A_LITTLE_MORE: Final = np.float32(1.0001)  # far more than rounding


@compiled
def turned(x: Lanes, y: Lanes, cosine: Lanes, sine: Lanes) -> tuple[Lanes, Lanes]:
    """Return a vector turned to the left by an angle."""
    return x * cosine - y * sine, x * sine + y * cosine


@compiled
def in_frame(x: Lanes, y: Lanes, cosine: Lanes, sine: Lanes) -> tuple[Lanes, Lanes]:
    """Return a vector in the frame of a heading: ahead, and to the left. Inverse of :func:`turned`."""
    return x * cosine + y * sine, y * cosine - x * sine


@compiled
def arc(
    cosine: np.float32, sine: np.float32, speed: np.float32, turn_rate: np.float32, time: np.float32
) -> tuple[np.float32, np.float32, np.float32, np.float32]:
    """Return (dx, dy, cos θ', sin θ') after holding (V, ω) for a time, (2-1) to (2-3).

    The chord of the arc has the length V dt sin(h) / h and the direction θ + h, h = ω dt / 2.
    """
    h = HALF * turn_rate * time
    h2 = h * h
    sinc = ONE - h2 * _C6 * (ONE - h2 * _C20 * (ONE - h2 * _C42))  # sin(h) / h, for |h| ≤ 0.5
    ch, sh = ONE - h2 * HALF * (ONE - h2 * _C12 * (ONE - h2 * _C30 * (ONE - h2 * _C56))), h * sinc
    chord = speed * time * sinc
    middle_c, middle_s = turned(cosine, sine, ch, sh)
    new_c, new_s = turned(middle_c, middle_s, ch, sh)
    # One Newton step keeps the heading a unit vector over any number of steps.
    scale = _THREE_HALVES - HALF * (new_c * new_c + new_s * new_s)
    return chord * middle_c, chord * middle_s, new_c * scale, new_s * scale


@compiled
def approach(value: Lanes, wanted: Lanes, most: np.float32) -> Lanes:
    """Return ``value`` moved towards ``wanted`` by at most ``most``; a number, or lanes."""
    return lesser(greater(wanted, value - most), value + most)


@compiled
def turn_towards(
    cosine: np.float32, sine: np.float32, wanted_c: np.float32, wanted_s: np.float32, most: np.float32, time: np.float32
) -> np.float32:
    """Return the turn rate, at most ``most``, that brings a heading to a wanted one in ``time``.

    By the shorter turn; from exactly the opposite heading, either.
    """
    along, across = in_frame(wanted_c, wanted_s, cosine, sine)
    # Usually the heading is out of reach or reached, and no inverse tangent is needed. The tangent
    # of the greatest turn is at most limit / near_one.
    limit = most * time
    near_one = ONE - HALF * limit * limit
    if near_one > ZERO and abs(across) * near_one > A_LITTLE_MORE * limit * along:
        return np.float32(math.copysign(most, across))
    if abs(across) < _SMALL * along:
        error = np.float32(across / along)
    else:
        error = np.float32(math.atan2(across, along))
    return min(max(error / time, -most), most)


@compiled
def follow_heading(
    psi_c: np.float32,
    psi_s: np.float32,
    heading_c: np.float32,
    heading_s: np.float32,
    most_c: np.float32,
    most_s: np.float32,
) -> tuple[np.float32, np.float32]:
    """Return (cos ψ, sin ψ) of the slot frame after one control step towards the heading.

    ``most_c``, ``most_s`` are the cosine and sine of ω_s dt, the maximum turn.
    """
    along, across = in_frame(heading_c, heading_s, psi_c, psi_s)
    if along >= most_c:
        return heading_c, heading_s
    c, s = turned(psi_c, psi_s, most_c, most_s if across >= ZERO else -most_s)
    scale = _THREE_HALVES - HALF * (c * c + s * s)
    return c * scale, s * scale
