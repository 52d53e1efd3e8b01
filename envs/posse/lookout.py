"""Waiting for another thread without falling asleep at once."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from numba.core import types
from numba.extending import intrinsic

from posse.compiled import kernel


def _reading(typing: Any, array: Any) -> Any:
    """Read the first number of an array from memory, where another thread may have written it."""

    def emit(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        data = context.make_array(sig.args[0])(context, builder, values[0]).data
        return builder.load_atomic(data, "acquire", 8)

    return types.int64(array), emit


_fresh: Any = intrinsic(_reading)


@kernel
def look_out(count: npt.NDArray[np.int64], before: int, looks: int, pause: int) -> bool:
    """Look until the count in a one-number array has changed; say whether it has.

    At most ``looks`` times, and ``pause`` times more after it has. Without the interpreter's lock.
    """
    for _ in range(looks):
        if _fresh(count) != before:
            for _ in range(pause):
                _fresh(count)
            return True
    return False
