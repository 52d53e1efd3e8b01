"""A setting of a scenario, written once: unit, range and meaning on the field, its kind by the annotation."""

import math
import reprlib
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import partial
from numbers import Integral, Real
from typing import Any, Final, NoReturn

import numpy as np

from posse.declarations import unknown

SPLITS: Final = ("train", "validation", "test")
"""Parts of all worlds, which have none in common."""


class ScenarioError(ValueError):
    """Invalid setting. The message names the field, its valid range and the fix."""


class UnknownSettingError(ScenarioError, TypeError):
    """A keyword that no scenario has; a TypeError too, as any unexpected keyword argument is."""


def fail(name: str, value: object, allowed: str) -> NoReturn:
    """Raise the error for an invalid value, with what is allowed."""
    raise ScenarioError(f"{name}={reprlib.repr(value)} is refused: {allowed}")


def check_count(name: str, value: object, least: int) -> int:
    """Return a whole number in [least, 2**63), or raise ScenarioError."""
    if not isinstance(value, (int, np.integer)) or isinstance(value, bool) or not least <= value < 2**63:
        raise ScenarioError(f"{name}={reprlib.repr(value)} must be a whole number in [{least}, 2**63)")
    return int(value)


def check_choice(name: str, value: object, choices: Iterable[str]) -> str:
    """Return one of the choices, or raise ScenarioError."""
    if not isinstance(value, str) or value not in choices:
        raise ScenarioError(unknown(name, value, choices))
    return value


@dataclass(frozen=True)
class Setting:
    """Declaration of one field of a scenario.

    Attributes:
        meaning: Its meaning, in one sentence.
        unit: SI unit; ``"1"`` for shares and counts, ``""`` for texts.
        low: Least value.
        high: Greatest value.
        above: Whether the range excludes ``low``.
        infinite: Whether ``math.inf`` is allowed beyond ``high``: no limit.
        choices: The valid values of a text, if not all are.
        kind: The annotation of the field, such as ``"int"`` or ``"tuple[float, float]"``.
    """

    meaning: str
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    above: bool = False
    infinite: bool = False
    choices: Iterable[str] | None = None
    kind: str = field(kw_only=True)

    @property
    def range(self) -> str:
        """The valid values, as text."""
        if self.choices is not None:
            return ", ".join(f'"{choice}"' for choice in self.choices)
        if self.kind == "bool":
            return "True or False"
        if math.isinf(self.low):
            return ""
        interval = f"{'(' if self.above else '['}{self.low:g}, {self.high:g}]"
        infinite = ", or be inf" if self.infinite else ""
        none = ", or be None" if "None" in self.kind else ""
        each = ", or one for each tracker" if "tuple[float, ...]" in self.kind else ""
        sides = ", or two finite ones" if self.kind == "float | tuple[float, float]" else ""
        return interval + infinite + none + each + sides

    def accept(self, name: str, value: object) -> Any:
        """Return a value as the scenario keeps it, Python's numbers for numpy's, tuples for lists; or ScenarioError."""
        if isinstance(value, np.ndarray):
            value = value.tolist()
        several = value if isinstance(value, (tuple, list)) else None
        match self.kind:
            case "float | tuple[float, ...]" if several is not None:
                return self._numbers(name, several)
            case "float | tuple[float, float]" if several is not None:
                if len(several) != 2:
                    fail(name, value, f"it must be a number in {self.range}: (width, height)")
                width, height = self._numbers(name, several)
                if width != height and math.inf in (width, height):
                    fail(name, value, "width and height must both be finite")
                return width if width == height else (width, height)  # equal scenarios compare equal
            case "tuple[float, float]":
                if several is None or len(several) != 2:
                    fail(name, value, f"it must be a tuple (least, greatest), both in {self.range}")
                least, most = self._numbers(name, several)
                if least > most:
                    fail(name, value, "the least must not be above the greatest")
                return least, most
            case "bool":
                if not isinstance(value, (bool, np.bool_)):
                    fail(name, value, "it must be True or False")
                return bool(value)
            case "str":
                if not isinstance(value, str):
                    fail(name, value, "it must be a string")
                return value if self.choices is None else check_choice(name, value, self.choices)
            case "tuple[str, ...]":
                names = (value,) if several is None else tuple(several)
                if not all(isinstance(each, str) for each in names) or len(set(names)) < len(names):
                    fail(name, value, "it must be a tuple of names, each once")
                return names
            case kind if kind.startswith("Mapping"):
                return self._weights(name, value)
        return None if value is None and "None" in self.kind else self._number(name, value)

    def _number(self, name: str, value: object) -> float:
        whole = self.kind.startswith("int")
        if isinstance(value, Integral if whole else Real) and not isinstance(value, bool):
            number: Any = value  # compared before it becomes a float, which a whole number may be too large for
            inside = self.low < number <= self.high if self.above else self.low <= number <= self.high
            if inside or (self.infinite and number == math.inf):
                return int(number) if whole else float(number)
        fail(name, value, f"it must be a {'whole ' if whole else ''}number in {self.range}")

    def _numbers(self, name: str, values: Iterable[object]) -> tuple[float, ...]:
        return tuple(self._number(f"{name}[{k}]", each) for k, each in enumerate(values))

    def _weights(self, name: str, value: object) -> tuple[tuple[str, float], ...]:
        """Return weights sorted by name, so that equal scenarios compare equal."""
        try:
            weights = dict(value)  # type: ignore[call-overload]
        except (TypeError, ValueError):
            weights = {None: 0.0}
        if not all(isinstance(term, str) for term in weights):
            fail(name, value, "it must map names of reward terms to numbers")
        return tuple(sorted((term, self._number(f"{name}[{term!r}]", weights[term])) for term in weights))


def setting(default: Any, meaning: str, *declared: Any, compare: bool = True, **more: Any) -> Any:
    """Return a dataclass field that declares a :class:`Setting`, whose kind is the field's annotation."""
    return field(default=default, compare=compare, metadata={"setting": partial(Setting, meaning, *declared, **more)})
