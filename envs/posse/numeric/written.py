"""Compiled functions whose lines are written out, one for each declared function that they call.

To call functions of a tuple one after the other, numba would have to know all of them as one type.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from posse.numeric.compiling import compiled


def written(
    name: str, parameters: Sequence[str], lines: Sequence[str], names: Mapping[str, Any]
) -> Callable[..., Any]:
    """Return a compiled function of these parameters and lines.

    It is called after the functions that it calls.

    Args:
        name: What it is called.
        parameters: Their names.
        lines: Of its body, indented as within it.
        names: What the lines use: functions, numbers.
    """
    body = "\n".join(f"    {line}" for line in lines or ("pass",))
    scope: dict[str, Any] = {**names, "__name__": __name__}
    exec(f"def {name}({', '.join(parameters)}):\n{body}\n", scope)
    function: Callable[..., Any] = scope[name]
    called = [value.__qualname__ for value in names.values() if callable(value)]
    function.__qualname__ = f"{name}({', '.join(called)})"
    return compiled(function)
