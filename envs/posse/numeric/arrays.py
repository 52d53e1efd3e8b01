"""Array types and constants shared by kernels and their callers."""

from typing import Any, Final

import numpy as np
import numpy.typing as npt

Record = Any
"""One element of a structured array; its fields are attributes that write in place."""
Records = npt.NDArray[Any]
"""A structured array, or a row of one."""
FloatArray = npt.NDArray[np.float32]
BoolArray = npt.NDArray[np.bool_]


def record_type(*fields: tuple[Any, ...]) -> np.dtype[Any]:
    """Return the type of a record with fields (name, type) or (name, type, shape); compiled code reads it by name."""
    return np.dtype((np.record, np.dtype(list(fields), align=True)))


# Compiled code calculates in float32 only if its constants are float32.
ZERO: Final = np.float32(0.0)
HALF: Final = np.float32(0.5)
ONE: Final = np.float32(1.0)
TINY: Final = np.float32(1e-9)
"""Less than any length or time that matters; keeps divisors from zero."""


class OwnArrays:
    """Base of classes with arrays, or tuples of arrays, as attributes; copies them on unpickling.

    Arrays pickled out of band (protocol 5, as in Ray and joblib) are read-only and possibly
    unaligned afterwards, but kernels require writable, aligned arrays.
    """

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update({name: _own(value) for name, value in state.items()})


def _own(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.copy()
    if isinstance(value, tuple):
        return getattr(value, "_make", tuple)(map(_own, value))  # _make: of a named tuple
    return value
