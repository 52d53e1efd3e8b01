"""numba type of functions as values, so that kernels can take named tuples of functions."""

from __future__ import annotations

from typing import Any

from numba.core import types
from numba.core.extending import models, register_model
from numba.core.imputils import lower_constant


class FunctionType(types.Dispatcher):
    """A function whose type identifies what to call, without a value at run time.

    numba's own type holds the function's address, which cannot be cached on disk.
    """


register_model(FunctionType)(models.OpaqueModel)


@lower_constant(FunctionType)
def _lower_function(context: Any, builder: Any, kind: Any, function: Any) -> Any:
    return context.get_dummy_value()


def widest(kind: Any) -> Any:
    """Return the type that a function is compiled for, given an argument's type."""
    plain = types.unliteral(kind)
    return types.int64 if plain in (types.int32, types.uint8) else plain
