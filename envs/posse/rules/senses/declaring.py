"""Declaration of target sensors, and their dispatch in a kernel.

A sensor determines whether the target is in sight, and its measured position. The result is a
*fix* (:data:`posse.rules.state.FIX_RECORD`), of one of these kinds:

============ ======================================================================================
``position`` position and heading of the target, slot frame; velocity from successive fixes
``bearing``  direction of the target; range, heading, frame and velocity stay unknown. Not sent by
             radio, since the direction depends on the observer
============ ======================================================================================
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from posse.numeric import compiled, written
from posse.registry import SENSORS, Function

FIX_KINDS: Final = ("position", "bearing")
SIGHT_PARAMETERS: Final = ("c", "w", "t", "dx", "dy", "s")
MEASURE_PARAMETERS: Final = ("c", "w", "number", "dx", "dy")


@dataclass(frozen=True, eq=False)
class Sensor:
    """A kind of target sensor."""

    name: str
    meaning: str
    sight: Function
    """(c, w, t, dx, dy, s) -> whether the target, (dx, dy) from tracker t, is in sight."""
    measure: Function | None
    """(c, w, number, dx, dy) -> the measured (dx, dy); None: the true one with the scenario's
    noise."""
    fix: str

    @property
    def functions(self) -> tuple[tuple[Function, str], ...]:
        """Its functions, and their kinds of return value."""
        measure = () if self.measure is None else ((self.measure, "pair"),)
        return (self.sight, "truth"), *measure


def sensor(name: str, *, measure: Function | None = None, fix: str = "position") -> Callable[[Function], Function]:
    """Declare a function as the sight of a kind of sensor; its docstring is the meaning.

    The function takes the scenario, the world, the tracker, the vector (dx, dy) to the target in
    the common frame, and scratch memory with the obstacles' positions, and returns whether the
    target is in sight. The built-in one is :func:`posse.rules.senses.in_sight`.

    Args:
        name: What ``sensor`` of a scenario calls it.
        measure: A function of the scenario, the world, the tracker's number and the vector to the
            target, which returns the measured vector. Default: the true one with the scenario's
            ``range_noise`` and ``bearing_noise``.
        fix: The kind of a fix, ``"position"`` or ``"bearing"``.

    Raises:
        DeclarationError: The name is taken, the docstring is missing, the parameters are others, or
            there is no such kind.
    """

    def declare(function: Function) -> Function:
        SENSORS.check_parameters(function, SIGHT_PARAMETERS, least=5)
        if measure is not None:
            SENSORS.check_parameters(measure, MEASURE_PARAMETERS)
        if fix not in FIX_KINDS:
            raise SENSORS.error(function, f"unknown fix={fix!r}; allowed: {', '.join(FIX_KINDS)}")
        sight = compiled(function)
        measuring = None if measure is None else compiled(measure)
        SENSORS.add(name, Sensor(name, inspect.getdoc(function) or "", sight, measuring, fix), sight)
        return sight

    return declare


def seeing(sensors: Sequence[Sensor]) -> Any:
    """Return (c, w, t, dx, dy, s) -> whether the sensor of ``c`` has the target."""
    lines: list[str] = []
    functions: dict[str, Any] = {}
    for k, each in enumerate(sensors):
        functions[f"sight_{k}"] = each.sight
        arguments = ", ".join(inspect.signature(each.sight).parameters)
        if k + 1 < len(sensors):
            lines.append(f"if c.sensor == {k}:")
        lines.append(f"{'    ' * (k + 1 < len(sensors))}return bool(sight_{k}({arguments}))")
    return written("sees", SIGHT_PARAMETERS, lines, functions)


def measuring(sensors: Sequence[Sensor], standard: Function) -> Any:
    """Return (c, w, number, dx, dy) -> where the sensor of ``c`` has the target."""
    lines: list[str] = []
    functions: dict[str, Any] = {"standard": standard, "f": np.float32}
    arguments = ", ".join(MEASURE_PARAMETERS)
    for k, each in enumerate(sensors):
        if each.measure is not None:
            functions[f"measure_{k}"] = each.measure
            lines += [f"if c.sensor == {k}:", f"    x, y = measure_{k}({arguments})", "    return f(x), f(y)"]
    lines.append(f"return standard({arguments})")
    return written("measure", MEASURE_PARAMETERS, lines, functions)
