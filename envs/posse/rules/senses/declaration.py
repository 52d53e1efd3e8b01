"""Declaration of target sensors.

A sensor determines whether the target is in sight, and its measured position. The result is a
*fix* (:data:`posse.rules.state.FIX_RECORD`), of one of these kinds:

============ ======================================================================================
``position`` position and heading of the target, slot frame; velocity from successive fixes
``bearing``  direction of the target; range, heading, frame and velocity stay unknown. Not sent by
             radio, since the direction depends on the observer
============ ======================================================================================
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Final

from posse.registry import SENSORS, Declaration, Function

FIX_KINDS: Final = ("position", "bearing")


@dataclass(frozen=True, eq=False, kw_only=True)
class Sensor(Declaration):
    """A kind of target sensor; its function tells whether the target is in sight.

    :func:`sensor` describes the attributes.
    """

    measure: Function | None = None
    fix: str = "position"
    returns: ClassVar[str] = "True or False"
    further: ClassVar = {"measure": (("c", "w", "number", "dx", "dy"), "2 numbers")}


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
    SENSORS.check_argument(name, '@posse.sensor("name")')

    def declare(function: Function) -> Function:
        if fix not in FIX_KINDS:
            raise SENSORS.error(function, f"unknown fix={fix!r}; allowed: {', '.join(FIX_KINDS)}")
        return SENSORS.declare(Sensor, function, name=name, measure=measure, fix=fix)

    return declare
