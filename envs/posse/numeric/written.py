"""Compiled functions generated as source text, with one line per declared function called.

numba cannot loop over a tuple of functions, since each function has a type of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from posse.numeric.compile import compiled


def written(name: str, parameters: Sequence[str], lines: Sequence[str], names: Mapping[str, Any]) -> Callable[..., Any]:
    """Return a compiled function generated from source lines.

    Args:
        name: Name of the function; the names of the functions that it calls are appended.
        parameters: Names of the parameters.
        lines: Lines of the body, indented relative to it.
        names: Global names used in the body: functions and numbers.
    """
    body = "\n".join(f"    {line}" for line in lines or ("pass",))
    scope: dict[str, Any] = {**names, "__name__": __name__}
    exec(f"def {name}({', '.join(parameters)}):\n{body}\n", scope)
    function: Callable[..., Any] = scope[name]
    called = [value.__qualname__ for value in names.values() if callable(value)]
    function.__qualname__ = f"{name}({', '.join(called)})"
    return compiled(function)
