"""Compiled functions whose lines are written out, one for each declared function that they call.

To call functions of a tuple one after the other, numba would have to know all of them as one type.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from posse.numeric.compiler.fingerprint import fingerprint
from posse.numeric.compiling import compiled


def written(
    name: str, parameters: Sequence[str], lines: Sequence[str], names: Mapping[str, Any]
) -> Callable[..., Any]:
    """Return a compiled function of these parameters and lines.

    It is called after the functions that it calls, and after a hash of those that are not posse's:
    kernels on disk are told apart by that.

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
    called = [_called(value) for value in names.values() if callable(value)]
    function.__qualname__ = f"{name}({', '.join(called)})"
    return compiled(function)


def _called(function: Any) -> str:
    own = getattr(function, "__module__", "").partition(".")[0] == __name__.partition(".")[0]
    return function.__qualname__ if own else f"{function.__qualname__}@{fingerprint(function)}"
