"""All that an object holds, field by field, without a list of fields that could lack one."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

_OURS: Final = ("posse", "pettingzoo", "gymnasium", "torchrl", "tests")
_NOT_STATE: Final = {"actions", "_recycler", "_scratch", "_first_bad"}
"""Where inputs are read into, and memory without meaning."""
_FIXED: Final = ("Space", "Scenario", "Layout", "Spec", "Composite")


def everything(value: Any, seen: dict[int, int] | None = None) -> Any:
    """Return copies of all numbers, texts, arrays and generators' states that an object reaches.

    What cannot be copied (functions, kernels, locks) stands there by its type.
    """
    seen = {} if seen is None else seen
    if value is None or isinstance(value, (bool, int, float, complex, str, bytes, np.generic)):
        return value
    if id(value) in seen:
        return f"again {seen[id(value)]}"
    seen[id(value)] = len(seen)
    if isinstance(value, np.ndarray):
        if value.dtype == object:
            return [everything(part, seen) for part in value.flat]
        # Records by their bytes: as numbers, one that is not a number differs from itself.
        return value.copy() if value.dtype.names is None else (str(value.dtype), value.tobytes())
    if isinstance(value, np.random.Generator):
        return repr(value.bit_generator.state)
    if isinstance(value, dict):
        return [(repr(key)[:100], everything(part, seen)) for key, part in value.items()]
    if isinstance(value, (list, tuple, set)):
        return [everything(part, seen) for part in value]
    kind = type(value)
    ours = kind.__module__.partition(".")[0] in _OURS
    fixed = any(part in base.__name__ for base in kind.__mro__ for part in _FIXED)
    if not ours or fixed or not hasattr(value, "__dict__"):
        return kind.__name__
    held = {k: v for k, v in vars(value).items() if k not in _NOT_STATE}
    return [kind.__name__, [(name, everything(held[name], seen)) for name in sorted(held)]]
