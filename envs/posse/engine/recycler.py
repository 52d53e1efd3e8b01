"""Reuse of the memory of returned arrays once they are no longer referenced."""

from __future__ import annotations

import math
import sys
from typing import Final

import numpy as np

from posse.numeric import FloatArray

_RECYCLED_FROM: Final = 1 << 16
"""Size from which the memory of an array is kept for the next step, bytes."""
_FLOAT32: Final = np.dtype(np.float32)


class Recycler:
    """Returns arrays of one shape, and reuses their memory once nothing else refers to it.

    Memory is never overwritten while an array, a view or a tensor on it exists, since each of them
    refers to the array that owns the memory. Allocating memory in every step would take as long as
    the step, since the system maps it page by page.
    """

    def __init__(self, shape: tuple[int, ...]) -> None:
        self._shape = shape
        self._recycle = math.prod(shape) * 4 >= _RECYCLED_FROM
        self._arrays: list[FloatArray] = []

    def take(self) -> FloatArray:
        """Return an uninitialised array to which there is no other reference."""
        if not self._recycle:
            return np.empty(self._shape, _FLOAT32)
        for k in range(len(self._arrays)):
            # Two references: of this list, and of the call's argument.
            if sys.getrefcount(self._arrays[k]) == 2:
                return self._arrays[k]
        array = np.empty(self._shape, np.float32)
        if len(self._arrays) < 4:
            self._arrays.append(array)
        return array
