"""Observations and states as Gymnasium spaces."""

from __future__ import annotations

import numpy as np
from gymnasium.spaces import Box

from posse.numeric import FloatArray

_APART = np.float32(1e-3)


def box(bounds: tuple[FloatArray, FloatArray]) -> Box:
    """Return a box of given bounds, float32.

    A constant entry (such as the team size) gets bounds slightly apart, since some tools divide by
    the width of a space.
    """
    low, high = bounds
    apart = np.where(low == high, _APART * np.maximum(1, np.abs(high)), 0).astype(np.float32)
    return Box(low - apart, high + apart, dtype=np.float32)
