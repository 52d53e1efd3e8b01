"""Names for the types that kernels and their callers share."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Record = Any
"""One element of a structured array: fields are read and written as attributes, in place."""
Records = npt.NDArray[Any]
"""A structured array, or a row of one."""
FloatArray = npt.NDArray[np.float32]
BoolArray = npt.NDArray[np.bool_]


class OwnArrays:
    """A base for classes that hold arrays, on their own or in tuples, and are pickled.

    Where the data travels out of band (pickle's protocol 5, as Ray and joblib use it), an unpickled
    array is read-only and may lie at any address. Kernels need it writable and aligned: copy it.
    """

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update({name: _own(value) for name, value in state.items()})


def _own(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.copy()
    return tuple(map(_own, value)) if type(value) is tuple else value
