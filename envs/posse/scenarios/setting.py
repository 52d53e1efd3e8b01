"""Declaration of a scenario's settings: unit, range, meaning and source.

A field of :class:`~posse.scenarios.scenario.Scenario` is declared by one of the functions below.
Its :class:`Setting` is in the field's metadata; checks, tables and messages are derived from it.
"""

from __future__ import annotations

import dataclasses
import difflib
import math
from collections.abc import Callable, Container, Iterable
from dataclasses import dataclass
from typing import Any, Final, NoReturn

from posse.shown import LONGEST, shown

GREATEST_WHOLE: Final = 2**62


class ScenarioError(ValueError):
    """Invalid setting. The message names the field, its valid range and the fix."""


class UnknownSettingError(ScenarioError, TypeError):
    """A keyword that no scenario has.

    Libraries that offer a keyword of their own to every environment, and then go on without it,
    look for a TypeError about an unexpected keyword argument, which the message says.
    """


@dataclass(frozen=True)
class Setting:
    """Declaration of one field of a scenario.

    Attributes:
        kind: ``"number"``, ``"whole"``, ``"pair"``, ``"flag"``, ``"text"`` or ``"other"``.
        unit: SI unit; ``"1"`` for shares and counts, ``""`` for texts.
        meaning: Its meaning, in one sentence.
        low: Least value.
        high: Greatest value.
        low_is_allowed: Whether the range includes ``low``.
        may_be_infinite: Whether ``math.inf`` is allowed beyond ``high``: no limit.
        may_be_none: Whether ``None`` is allowed.
        per_tracker: Whether it may be a tuple, one value for each tracker.
        choices: Returns the valid values of a text.
        source: Section of the paper.
    """

    kind: str
    unit: str
    meaning: str
    low: float = -math.inf
    high: float = math.inf
    low_is_allowed: bool = True
    may_be_infinite: bool = False
    may_be_none: bool = False
    per_tracker: bool = False
    choices: Callable[[], Iterable[str]] | None = None
    source: str = ""

    @property
    def range(self) -> str:
        """The valid values, as text."""
        if self.choices is not None:
            return ", ".join(f'"{choice}"' for choice in self.choices())
        if self.kind == "flag":
            return "True or False"
        if self.kind in ("text", "other"):
            return ""
        opening = "[" if self.low_is_allowed else "("
        closing = ")" if math.isinf(self.high) else "]"
        infinite = ", or be inf" if self.may_be_infinite and math.isfinite(self.high) else ""
        none = ", or be None" if self.may_be_none else ""
        each = ", or one for each tracker" if self.per_tracker else ""
        return f"{opening}{self.low:g}, {self.high:g}{closing}{infinite}{none}{each}"


def declare(default: Any, setting: Setting) -> Any:
    """Return a dataclass field with this default and declaration."""
    return dataclasses.field(default=default, metadata={"setting": setting})


def number(
    default: float,
    unit: str,
    low: float,
    high: float,
    meaning: str,
    *,
    above: bool = False,
    infinite: bool = False,
    per_tracker: bool = False,
    source: str = "",
) -> Any:
    """Declare a real number in [low, high], or in (low, high] with ``above``."""
    setting = Setting("number", unit, meaning, low, high, not above, infinite, per_tracker=per_tracker, source=source)
    return declare(default, setting)


def whole(
    default: int | None, low: int, high: float, meaning: str, *, unit: str = "1", none: bool = False, source: str = ""
) -> Any:
    """Declare a whole number in [low, high]."""
    return declare(default, Setting("whole", unit, meaning, low, high, may_be_none=none, source=source))


def pair(default: tuple[float, float], unit: str, high: float, meaning: str) -> Any:
    """Declare two numbers (least, greatest), 0 <= least <= greatest <= high."""
    return declare(default, Setting("pair", unit, meaning, 0, high))


def flag(default: bool, meaning: str) -> Any:
    """Declare a boolean."""
    return declare(default, Setting("flag", "", meaning))


def text(default: Any, meaning: str, choices: Callable[[], Iterable[str]] | None = None, source: str = "") -> Any:
    """Declare a string, one of ``choices()`` where given."""
    return declare(default, Setting("text", "", meaning, choices=choices, source=source))


def setting_of(field: dataclasses.Field[Any]) -> Setting:
    """Return the declaration of a scenario's field."""
    setting: Setting = field.metadata["setting"]
    return setting


def check(name: str, value: object, setting: Setting) -> None:
    """Raise if a value is invalid for its setting.

    Raises:
        ScenarioError: A wrong type, or out of range; names the setting and its range.
    """
    if value is None and setting.may_be_none:
        return
    if setting.kind == "whole":
        if not isinstance(value, int) or isinstance(value, bool):
            fail(name, value, "it must be a whole number")
        _check_range(name, value, setting)
    elif setting.kind == "number":
        if setting.per_tracker and isinstance(value, tuple):
            for number, each in enumerate(value):
                check(f"{name}[{number}]", each, dataclasses.replace(setting, per_tracker=False))
            return
        if not is_number(value) or math.isnan(value):  # type: ignore[arg-type]
            fail(name, value, "it must be a number")
        _check_range(name, value, setting)  # type: ignore[arg-type]
    elif setting.kind == "pair":
        _check_pair(name, value, setting)
    elif setting.kind == "flag":
        if not isinstance(value, bool):
            fail(name, value, "it must be True or False")
    elif setting.kind == "text":
        _check_text(name, value, setting)


def _check_range(name: str, value: float, setting: Setting) -> None:
    if value == math.inf:
        if setting.may_be_infinite:
            return
        if setting.kind == "number":
            fail(name, value, "it must be finite")
    low_is_missed = value < setting.low or (value == setting.low and not setting.low_is_allowed)
    if low_is_missed or value > setting.high:
        fail(name, value, f"it must lie in {setting.range}")


def _check_pair(name: str, value: object, setting: Setting) -> None:
    if not (
        isinstance(value, tuple)
        and len(value) == 2
        and all(is_number(v) and math.isfinite(v) for v in value)
        and 0 <= value[0] <= value[1]
    ):
        fail(name, value, "it must be a tuple (least, greatest), 0 <= least <= greatest")
    if value[1] > setting.high:
        fail(name, value, f"both must lie in [0, {setting.high:g}]")


def _check_text(name: str, value: object, setting: Setting) -> None:
    if not isinstance(value, str):
        fail(name, value, "it must be a string")
    choices = None if setting.choices is None else tuple(setting.choices())
    if choices is not None and value not in choices:
        raise ScenarioError(f"unknown {name}={shown(value)}{near(value, choices)}; known: {', '.join(choices)}")


def is_one_of(names: Container[str], value: object) -> bool:
    """Return whether a value is a string and one of the names."""
    return isinstance(value, str) and value in names


def is_number(value: object) -> bool:
    """Return whether a value is a real number that a float can hold, and not a boolean."""
    if not isinstance(value, (int, float)) or isinstance(value, bool):
        return False
    return not isinstance(value, int) or abs(value) <= GREATEST_WHOLE


def near(name: str, names: Iterable[str]) -> str:
    """Return a hint with the names similar to an unknown one, or an empty string."""
    found = difflib.get_close_matches(name[:LONGEST], tuple(names), n=3)
    return f" (did you mean {' or '.join(map(repr, found))}?)" if found else ""


def fail(name: str, value: object, allowed: str) -> NoReturn:
    """Raise the error for an invalid value, with what is allowed."""
    raise ScenarioError(f"{name}={shown(value)} is not possible: {allowed}")
