"""Counter-based random numbers: a draw is a pure function of (key, step, stream, index).

There is no generator state, so results do not depend on the order in which worlds are stepped or on
the number of threads, and a world of a batch replays alone bit for bit. The mixing function is the
finalizer of SplitMix64 (Steele, Lea & Flood 2014), applied once per coordinate.
"""

import math
from typing import Final

import numpy as np

from posse.numeric import compiled

# One stream per use, so that no two uses share a draw.
START: Final = np.uint64(1)
OBSTACLES: Final = np.uint64(2)
TARGET: Final = np.uint64(3)
FAULTS: Final = np.uint64(4)
SENSOR_NOISE: Final = np.uint64(5)
RADIO_LOSS: Final = np.uint64(6)
DRIFT: Final = np.uint64(7)
HEADING_NOISE: Final = np.uint64(8)

_GOLDEN: Final = np.uint64(0x9E3779B97F4A7C15)
_MIX_A: Final = np.uint64(0xBF58476D1CE4E5B9)
_MIX_B: Final = np.uint64(0x94D049BB133111EB)
_S27: Final = np.uint64(27)
_S30: Final = np.uint64(30)
_S31: Final = np.uint64(31)
_S40: Final = np.uint64(40)
_TO_UNIT: Final = np.float32(2.0**-24)
TWO_PI: Final = np.float32(2.0 * math.pi)
_CUT: Final = np.float32(math.exp(-4.5))  # exp(-3²/2): radius 3 of the normal plane
_KEPT: Final = np.float32(1.0 - math.exp(-4.5))
_MINUS_TWO: Final = np.float32(-2.0)


@compiled
def mix(key: np.uint64, value: np.uint64) -> np.uint64:
    """Return a new 64-bit word from a key and a counter; changing either changes every bit."""
    z = (key + _GOLDEN) ^ (value * _GOLDEN)
    z = (z ^ (z >> _S30)) * _MIX_A
    z = (z ^ (z >> _S27)) * _MIX_B
    return z ^ (z >> _S31)


@compiled
def episode_key(seed: int, split: int, world: int, episode: int) -> np.uint64:
    """Return the key of one episode of one world, from which all its draws are derived."""
    key = mix(np.uint64(0), np.uint64(seed))
    key = mix(key, np.uint64(split))
    key = mix(key, np.uint64(world))
    return mix(key, np.uint64(episode))


@compiled
def bits(key: np.uint64, step: int, stream: np.uint64, index: int) -> np.uint64:
    """Return 64 random bits."""
    return mix(mix(mix(key, np.uint64(step)), stream), np.uint64(index))


@compiled
def uniform(key: np.uint64, step: int, stream: np.uint64, index: int) -> np.float32:
    """Return a float32 drawn uniformly from [0, 1)."""
    return np.float32(bits(key, step, stream, index) >> _S40) * _TO_UNIT


@compiled
def between(low: float, high: float, key: np.uint64, step: int, stream: np.uint64, index: int) -> np.float32:
    """Return a float32 drawn uniformly from [low, high)."""
    return np.float32(low + (high - low) * uniform(key, step, stream, index))


@compiled
def normal_pair(key: np.uint64, step: int, stream: np.uint64, index: int) -> tuple[np.float32, np.float32]:
    """Return two normal float32, drawn inside a circle of radius 3.

    Box-Muller with the radius truncated at 3, so that neither number exceeds 3 in absolute value, and their standard
    deviation is 0.974 instead of 1.
    """
    u = uniform(key, step, stream, 2 * index)
    angle = TWO_PI * uniform(key, step, stream, 2 * index + 1)
    radius = np.float32(math.sqrt(_MINUS_TWO * np.float32(math.log(_CUT + _KEPT * u))))
    return (radius * np.float32(math.cos(angle)), radius * np.float32(math.sin(angle)))
