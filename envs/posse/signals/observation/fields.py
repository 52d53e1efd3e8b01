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

import inspect
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from posse.numeric import compiled
from posse.registry import FIELDS, Function
from posse.scenarios import Scenario

Bound = float | Callable[[Scenario], float]

SLACK: Final = 1.001
"""Factor by which bounds are widened to allow for float32 rounding."""

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


@dataclass(frozen=True)
class FieldDeclaration:
    """A field of any scenario, and the function that computes it."""

    name: str
    subject: str
    """Its subject: ``"setting"``, ``"self"`` or ``"mate"``."""
    size: int
    unit: str
    low: Bound
    high: Bound
    unknown: float | None
    meaning: str
    function: Function
    fixed: bool = False
    """Whether its value for a robot never changes."""

    def of(self, scenario: Scenario) -> Field:
        """Return the field in a scenario.

        Raises:
            DeclarationError: Its bounds are not finite, or low is above high.
        """
        low, high = (self._bound(name, scenario) for name in ("low", "high"))
        if not low <= high:
            raise self._error(f"low={low:g} is above high={high:g} in {scenario.name!r}")
        return Field(
            self.name, self.size, self.unit, low, high, self.meaning, self.unknown, of_neighbour=self.subject == "mate"
        )

    @property
    def functions(self) -> tuple[tuple[Function, str], ...]:
        """The functions that it consists of, and what each returns."""
        return ((self.function, f"{self.size} numbers" if self.size > 1 else "number"),)

    def _bound(self, name: str, scenario: Scenario) -> float:
        bound: Any = getattr(self, name)
        try:
            value = bound(scenario) if callable(bound) else bound
        except Exception as error:  # a user's function
            raise self._error(f"{name} of {scenario.name!r}: {error!r}") from error
        if not isinstance(value, (int, float)) or not math.isfinite(value):
            raise self._error(f"{name}={value!r} in {scenario.name!r} is not a finite number")
        return float(value)

    def _error(self, reason: str) -> Exception:
        return FIELDS.error(self.function, reason)


def field(
    unit: str, low: Bound, high: Bound, unknown: float | None = None, *, size: int = 1, fixed: bool = False
) -> Callable[[Function], Function]:
    """Declare a function as an observation field of its name; its docstring is the meaning.

    Args:
        unit: Its unit; ``"1"`` for a plain number.
        low: The least value, or a function (scenario) -> least value.
        high: The greatest, likewise.
        unknown: The value for "unknown"; also in empty places of team-mates (default there: 0).
        size: Number of values that the function returns, as a tuple if more than one.
        fixed: Its value for a robot never changes, as that of a setting.

    Raises:
        DeclarationError: The name is taken, the docstring is missing, or the parameters are not
            (c), (c, v) or (c, v, m).
    """

    def declare(function: Function) -> Function:
        FIELDS.check_parameters(function, ("c", "v", "m"), least=1)
        if size < 1:
            raise FIELDS.error(function, f"size={size} must be at least 1")
        count = len(inspect.signature(function).parameters)
        name, meaning = function.__name__, inspect.getdoc(function) or ""
        working = compiled(function)
        FIELDS.add(
            name,
            FieldDeclaration(
                name, _SUBJECTS[count], size, unit, low, high, unknown, meaning, working, fixed or count == 1
            ),
            working,
        )
        return working

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
