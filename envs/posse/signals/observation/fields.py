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
from typing import Any, Final

from posse.registry import FIELDS, Declaration, Function, is_number, parameters_of
from posse.scenarios import Scenario

Bound = float | Callable[[Scenario], float]

SLACK: Final = 1.001
"""Factor by which bounds are widened to allow for float32 rounding."""

MOST_NUMBERS: Final = 256
"""Most values of one field."""

_SUBJECTS: Final = {1: "setting", 2: "self", 3: "mate"}


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
    def subject(self) -> str:
        """``"setting"``, ``"self"`` or ``"mate"``."""
        return _SUBJECTS[len(parameters_of(self.function))]

    @property
    def functions(self) -> tuple[tuple[Function, str], ...]:
        """Its function, and what it returns."""
        return ((self.function, f"{self.size} numbers" if self.size > 1 else "a number"),)

    def of(self, scenario: Scenario) -> Field:
        """Return the field in a scenario.

        Raises:
            DeclarationError: Its bounds are not finite, low is above high, or the value for
                "unknown" is not between them.
        """
        low, high = (self._bound(name, scenario) for name in ("low", "high"))
        if not low <= high:
            raise FIELDS.error(self.function, f"low={low:g} is above high={high:g} in {scenario.name!r}")
        mate = self.subject == "mate"
        empty = 0.0 if self.unknown is None and mate else self.unknown
        if empty is not None and not low <= empty <= high:
            raise FIELDS.error(
                self.function, f"unknown={empty:g} is not between low={low:g} and high={high:g} in {scenario.name!r}"
            )
        return Field(self.name, self.size, self.unit, low, high, self.meaning, self.unknown, of_neighbour=mate)

    def _bound(self, name: str, scenario: Scenario) -> float:
        bound: Any = getattr(self, name)
        try:
            value = bound(scenario) if callable(bound) else bound
        except Exception as error:  # a user's function
            raise FIELDS.error(self.function, f"{name} of {scenario.name!r}: {error!r}") from error
        if not is_number(value):
            raise FIELDS.error(self.function, f"{name}={value!r} in {scenario.name!r} is not a finite number")
        return float(value)


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

    Raises:
        DeclarationError: The name is taken, the docstring is missing, an argument is wrong, or the
            parameters are not (c), (c, v) or (c, v, m).
    """

    def declare(function: Function) -> Function:
        if type(size) is not int or not 1 <= size <= MOST_NUMBERS:
            raise FIELDS.error(function, f"size={size!r} must be a whole number from 1 to {MOST_NUMBERS}")
        if unknown is not None and not is_number(unknown):
            raise FIELDS.error(function, f"unknown={unknown!r} is not a finite number")
        for name, bound in (("low", low), ("high", high)):
            if not callable(bound) and not is_number(bound):
                raise FIELDS.error(function, f"{name}={bound!r} is neither a finite number nor a function")
        return FIELDS.declare(FieldDeclaration, function, unit=unit, low=low, high=high, unknown=unknown, size=size)

    return declare


def setting(unit: str, value: Callable[[Scenario], float]) -> Callable[[Function], Function]:
    """Declare a function (c) as a field that holds a setting; -1 stands for an unlimited one.

    Its range holds the value, 0 and 1: wrappers of other libraries pad observations with 0 and 1.
    """

    def low(s: Scenario) -> float:
        return -1.0 if math.isinf(value(s)) else 0.0

    def high(s: Scenario) -> float:
        return 1.0 if math.isinf(value(s)) else max(1.0, value(s) * SLACK)

    return field(unit, low, high)
