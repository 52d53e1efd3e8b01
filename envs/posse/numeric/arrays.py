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
