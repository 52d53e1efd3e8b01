"""Memory of the arrays that a batch returns, used again when nobody holds them any more."""

from __future__ import annotations

import math
import sys
from typing import Final

import numpy as np

from posse.numeric import FloatArray

_RECYCLED_FROM: Final = 1 << 16
"""Bytes from which an array's memory is worth keeping for the next step."""
_FLOAT32: Final = np.dtype(np.float32)


class Recycler:
    """Gives out arrays of one shape; takes the memory back once nobody else refers to it.

    What was returned is never overwritten while anyone holds it (a view, a tensor made from it):
    each of these is a reference to the array that owns the memory. Fresh memory for every step
    would cost as much as the step: the system hands it out page by page.
    """

    def __init__(self, shape: tuple[int, ...]) -> None:
        self._shape = shape
        self._recycle = math.prod(shape) * 4 >= _RECYCLED_FROM
        self._arrays: list[FloatArray] = []

    def take(self) -> FloatArray:
        """Return an uninitialised array that nobody else refers to."""
        if not self._recycle:
            return np.empty(self._shape, _FLOAT32)
        for k in range(len(self._arrays)):
            # Two references: this list's, and the argument's of the call itself.
            if sys.getrefcount(self._arrays[k]) == 2:
                return self._arrays[k]
        array = np.empty(self._shape, np.float32)
        if len(self._arrays) < 4:
            self._arrays.append(array)
        return array
