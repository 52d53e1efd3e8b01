"""Observations and states as Gymnasium spaces."""

from __future__ import annotations

import numpy as np
from gymnasium.spaces import Box

from posse.numeric import FloatArray

_APART = np.float32(1e-3)


def box(bounds: tuple[FloatArray, FloatArray]) -> Box:
    """Return a box of given bounds, float32.

    A number that is the same in every world of a scenario (the team's size) gets bounds a little
    apart: tools that divide by the width of a space must not divide by zero.
    """
    low, high = bounds
    apart = np.where(low == high, _APART * np.maximum(1, np.abs(high)), 0).astype(np.float32)
    return Box(low - apart, high + apart, dtype=np.float32)
