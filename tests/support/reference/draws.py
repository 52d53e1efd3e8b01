"""The random draws, in Python's integers."""

from __future__ import annotations

import math

_MASK = 2**64 - 1
_GOLDEN = 0x9E3779B97F4A7C15


def _mix(key: int, value: int) -> int:
    z = ((key + _GOLDEN) & _MASK) ^ (value * _GOLDEN & _MASK)
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9 & _MASK
    z = (z ^ (z >> 27)) * 0x94D049BB133111EB & _MASK
    return z ^ (z >> 31)


def uniform(key: int, step: int, stream: int, index: int) -> float:
    """Return the engine's uniform draw, from the definition of SplitMix64's finalizer."""
    for value in (step, stream, index):
        key = _mix(key, value)
    return (key >> 40) / 2**24


def normal_pair(key: int, step: int, stream: int, index: int) -> tuple[float, float]:
    """Return the engine's pair of normal draws, cut at radius 3."""
    u = uniform(key, step, stream, 2 * index)
    angle = 2 * math.pi * uniform(key, step, stream, 2 * index + 1)
    cut = math.exp(-4.5)
    radius = math.sqrt(-2 * math.log(cut + (1 - cut) * u))
    return radius * math.cos(angle), radius * math.sin(angle)
