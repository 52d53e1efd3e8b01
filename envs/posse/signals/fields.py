"""Declaration of observation fields.

A field is declared on its formula. The parameters of the function determine its subject:

========== =====================================================================================
(c)        a setting of the scenario, a constant
(c, v)     an observation of the robot itself or the target (:class:`~.views.View`)
(c, v, m)  an observation of a team-mate (:class:`~.views.Mate`), for each of them
========== =====================================================================================

``c`` is the scenario as kernels read it (:data:`posse.rules.state.CONFIG`). ``v`` and ``m`` hold
eight observers, so a formula is written for a block of eight numbers like for one
(:mod:`posse.numeric`). A function returns a number, or a tuple of ``size`` of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from posse.numeric import Record
from posse.registry import FIELDS, Bound, Declaration, Function, is_number
from posse.scenarios import Scenario
from posse.scenarios.limits import FAR

SLACK: Final = 1.001
"""Factor by which bounds are widened to allow for float32 rounding."""

MOST_NUMBERS: Final = 256
"""Most values of one field."""


@dataclass(frozen=True)
class Field:
    """One named part of a scenario's observation."""

    name: str
    size: int
    unit: str
    low: float
    high: float
    meaning: str
    unknown: float | None = None
    """The value for "unknown", or ``None`` if it is always known."""
    of_neighbour: bool = False
    """Whether it is repeated for each place of a team-mate."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FieldDeclaration(Declaration):
    """A field of any scenario, and the function that computes it."""

    size: int
    low: Bound
    high: Bound
    unknown: float | None

    @property
    def of_mate(self) -> bool:
        """Whether it describes a team-mate."""
        return "m" in self.parameters

    @property
    def functions(self) -> dict[Function, str]:
        """Its function, and what it returns."""
        return {self.function: f"{self.size} numbers" if self.size > 1 else "a number"}

    def of(self, scenario: Scenario) -> Field:
        """Return the field in a scenario; raise DeclarationError if its bounds or its value for "unknown" are wrong."""
        low, high = FIELDS.bounds_of(self.function, self.low, self.high, scenario)
        empty = 0.0 if self.unknown is None and self.of_mate else self.unknown
        if empty is not None and not (is_number(empty) and low <= empty <= high):
            where = f"between low={low:g} and high={high:g} in {scenario.name!r}"
            raise FIELDS.error(self.function, f"unknown={empty!r} is not a number {where}")
        return Field(self.name, self.size, self.unit, low, high, self.meaning, self.unknown, self.of_mate)


def field(
    unit: str, low: Bound, high: Bound, unknown: float | None = None, *, size: int = 1
) -> Callable[[Function], Function]:
    """Declare a function as an observation field of its name; its docstring is the meaning.

    Args:
        unit: Its unit; ``"1"`` for a plain number.
        low: The least value, or a function (scenario) -> least value.
        high: The greatest, likewise.
        unknown: The value for "unknown"; also in empty places of team-mates (default there: 0).
        size: Number of values that the function returns, at most 256; as a tuple if more than one.
    """

    def declare(function: Function) -> Function:
        if type(size) is not int or not 1 <= size <= MOST_NUMBERS:
            raise FIELDS.error(function, f"size={size!r} must be a whole number from 1 to {MOST_NUMBERS}")
        return FIELDS.declare(FieldDeclaration, function, unit=unit, low=low, high=high, unknown=unknown, size=size)

    return declare


def setting(name: str) -> None:
    """Declare a number of the scenario as a field of its name, with its unit and meaning; -1 for an unlimited one.

    The range holds the value, 0 and 1: wrappers of other libraries pad observations with 0 and 1.
    """
    declared = Scenario.settings()[name]

    def limited(c: Record) -> np.float32:
        return np.float32(c[name] if c[name] < FAR else -1.0)

    def low(s: Scenario) -> float:
        return -1.0 if math.isinf(getattr(s, name)) else 0.0

    def high(s: Scenario) -> float:
        value: float = getattr(s, name)
        return 1.0 if math.isinf(value) else max(1.0, value * SLACK)

    limited.__name__ = name
    limited.__doc__ = f"{declared.meaning[0].upper()}{declared.meaning[1:]}.".replace("inf:", "-1:")
    field(declared.unit, low, high)(limited)
