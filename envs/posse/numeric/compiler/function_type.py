"""What a compiled function is as a value, so that named tuples of functions reach kernels."""

from __future__ import annotations

from typing import Any

from numba.core import types
from numba.core.extending import models, register_model
from numba.core.imputils import lower_constant


class FunctionType(types.Dispatcher):
    """A function as compiled code has it: a type, which says what to call, and no value.

    numba's own has the function's address for a value, which no cache could keep.
    """


register_model(FunctionType)(models.OpaqueModel)


@lower_constant(FunctionType)
def _lower_function(context: Any, builder: Any, kind: Any, function: Any) -> Any:
    return context.get_dummy_value()
