"""Declarations by name: observation fields, reward terms, metrics, target motions, sensors.

A declaration is a function with a name, a unit and a meaning, which is its docstring. Those of
posse's own modules are *built in* and apply to every world. Those of a user's module are available
after its import, and a scenario selects them by name.
"""

from __future__ import annotations

import dataclasses
import difflib
import inspect
import math
import os
import reprlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from types import FunctionType
from typing import Any, ClassVar, Final, TypeVar

import numpy as np

from posse.numeric import compiled, stamp

Function = Callable[..., Any]
Parameters = tuple[str, ...]
Bound = float | Callable[[Any], float]
"""A number, or a function of the scenario that returns one."""

_PACKAGE: Final = __name__.partition(".")[0]


def unknown(kind: str, name: object, known: Iterable[str]) -> str:
    """Return the message for a name that is none of the known ones, with those most like it."""
    names, text = tuple(known), name if isinstance(name, str) else reprlib.repr(name)
    near = difflib.get_close_matches(text[:100], names, n=3, cutoff=0.5)
    hint = f" (did you mean {' or '.join(map(repr, near))}?)" if near else ""
    return f"unknown {kind} {reprlib.repr(name)}{hint}; known: {', '.join(names) or 'none'}"


class DeclarationError(ValueError):
    """An invalid declaration. The message names the function, its file and line."""


def plain(function: Any) -> Any:
    """Return the Python function of a compiled one."""
    return getattr(function, "py_func", function)


def parameters_of(function: Function) -> Parameters:
    """Return the names of a function's parameters."""
    return tuple(inspect.signature(plain(function)).parameters)


def place_of(function: Function) -> str:
    """Return a function's name, file and line, for messages."""
    code = getattr(plain(function), "__code__", None)
    if code is None:
        return repr(function)
    return f"{plain(function).__name__} ({os.path.relpath(code.co_filename)}:{code.co_firstlineno})"


def is_number(value: object) -> bool:
    """Return whether a value is a finite number; truth values are none."""
    return isinstance(value, (int, float, np.number)) and not isinstance(value, bool) and math.isfinite(value)


@dataclass(frozen=True, eq=False, kw_only=True)
class Declaration:
    """A declared function.

    Attributes:
        name: Its name.
        unit: Unit of its value; empty for rules, which have none.
        meaning: Its docstring.
        function: The function, compiled.
        returns: What it returns.
        further: Names of further functions, each with its parameters and what it returns; ``None`` if it is not given.
    """

    name: str
    unit: str = ""
    meaning: str
    function: Function
    returns: ClassVar[str] = "a number"
    further: ClassVar[Mapping[str, tuple[Parameters, str]]] = {}

    @property
    def functions(self) -> dict[Function, str]:
        """The functions for compiled code, and what each returns."""
        further = {getattr(self, name): returns for name, (_, returns) in self.further.items() if getattr(self, name)}
        return {self.function: self.returns, **further}

    @property
    def built_in(self) -> bool:
        """Whether posse itself declares it."""
        return str(plain(self.function).__module__).partition(".")[0] == _PACKAGE

    @property
    def parameters(self) -> Parameters:
        """Names of the function's parameters."""
        return parameters_of(self.function)

    def fingerprint(self) -> str:
        """Return a hash of the options and of all that its functions reach."""
        return stamp(*(getattr(self, field.name) for field in dataclasses.fields(self)))


D = TypeVar("D", bound=Declaration)


class Registry(dict[str, D]):
    """Declarations of one kind by name, in order.

    Args:
        kind: Name of the kind for messages, such as ``"reward term"``.
        *allowed: The lists of parameters that its functions may have.
    """

    def __init__(self, kind: str, *allowed: Parameters) -> None:
        super().__init__()
        self.kind = kind
        self.allowed = allowed

    def declare(self, make: type[D], function: Any, *, name: Any = None, **options: Any) -> Function:
        """Add the declaration that is made on a function, and return the function, compiled.

        It replaces one that was made on a function of the same module and qualified name.

        Args:
            make: The class of the declaration.
            function: The function.
            name: The declaration's name; default: that of the function.
            **options: Further attributes of the declaration.

        Raises:
            DeclarationError: The name is invalid or taken, a function has no docstring or other
                parameters, or its unit is none.
        """
        parameters = self.check_function(function, *self.allowed)
        for further, (wanted, _) in make.further.items():
            if options.get(further) is not None:
                self.check_function(options[further], wanted)
                options[further] = compiled(plain(options[further]))
        name = plain(function).__name__ if name is None else name
        if not isinstance(name, str) or not name.replace("-", "_").isidentifier():
            raise self.error(function, f"invalid name {name!r}: use letters, digits, _ and -")
        taken = self.get(name)
        if taken is not None and _home(taken.function) != _home(function):
            raise self.error(function, f"the name {name!r} is taken by {place_of(taken.function)}")
        meaning = inspect.getdoc(plain(function)) or ""
        if not meaning.strip():
            raise self.error(function, "its docstring, which must state its meaning, is missing")
        unit = options.get("unit", "-")
        if not isinstance(unit, str) or not unit:
            raise self.error(function, f'unit={unit!r} must be a text, such as "m/s", or "1" for a plain number')
        working: Function = compiled(plain(function)) if parameters[0] == "c" else function
        self[name] = make(name=name, meaning=meaning, function=working, **options)
        return working

    def check_function(self, function: Any, *allowed: Parameters) -> Parameters:
        """Return the parameters of a function; raise DeclarationError unless it is one with parameters allowed."""
        if not isinstance(plain(function), FunctionType):
            raise self.error(function, f"declare a function, made by def, not a {type(function).__name__}")
        signature = inspect.signature(plain(function))
        bare = [each.replace(annotation=each.empty) for each in signature.parameters.values()]
        given = str(signature.replace(parameters=bare, return_annotation=signature.empty))  # with * and defaults
        wanted = [f"({', '.join(each)})" for each in allowed]
        if given not in wanted:
            raise self.error(function, f"its parameters are {given}, not {' or '.join(wanted)}")
        return parameters_of(function)

    def check_argument(self, argument: object, usage: str) -> None:
        """Raise if a decorator was used without its arguments, on the function itself."""
        if callable(argument):
            raise self.error(argument, f"the decorator needs arguments: {usage}")

    def bounds_of(self, function: Function, low: Bound, high: Bound, scenario: Any, of: str = "") -> list[float]:
        """Return the bounds ``of`` a value in a scenario; raise unless they are finite and in order."""
        values = []
        for name, bound in (("low", low), ("high", high)):
            try:
                value = bound(scenario) if callable(bound) else bound
            except Exception as error:  # a user's function
                raise self.error(function, f"{name}{of} in {scenario.name!r}: {error!r}") from error
            if not is_number(value):
                raise self.error(function, f"{name}={value!r}{of} in {scenario.name!r} is not a finite number")
            values.append(float(value))
        if values[0] > values[1]:
            raise self.error(function, f"low={values[0]:g}{of} is above high={values[1]:g} in {scenario.name!r}")
        return values

    def error(self, function: Function, reason: str) -> DeclarationError:
        """Return the error for an invalid declaration."""
        return DeclarationError(f"{self.kind} {place_of(function)}: {reason}")

    def is_built_in(self, name: str) -> bool:
        """Return whether posse itself declares this name."""
        return self[name].built_in

    def built_in(self) -> tuple[D, ...]:
        """Return the built-in declarations, in order."""
        return tuple(each for each in self.values() if each.built_in)

    def with_added(self, *names: str) -> tuple[D, ...]:
        """Return the built-in declarations, then the named ones, each once.

        Raises:
            KeyError: An unknown name; the message suggests similar ones.
        """
        added = (self[name] for name in dict.fromkeys(names))
        return (*self.built_in(), *(each for each in added if not each.built_in))

    def unknown(self, name: object) -> str:
        """Return the message for an unknown name."""
        return f"{unknown(self.kind, name, self)}. To use a declaration of your own, import its module first"

    def __missing__(self, name: str) -> D:
        raise KeyError(self.unknown(name))


def _home(function: Function) -> tuple[str, str]:
    return plain(function).__module__, plain(function).__qualname__


FIELDS: Final[Registry[Any]] = Registry("observation field", ("c",), ("c", "v"), ("c", "v", "m"))
METRICS: Final[Registry[Any]] = Registry(
    "metric", ("c", "w"), ("c", "w", "t"), ("c", "w", "trackers"), ("c", "w", "trackers", "slots"), ("s", "w")
)
REWARD_TERMS: Final[Registry[Any]] = Registry("reward term", ("c", "w", "t"), ("c", "w"))
SENSORS: Final[Registry[Any]] = Registry("sensor", ("c", "w", "t", "dx", "dy"), ("c", "w", "t", "dx", "dy", "s"))
TARGET_MOTIONS: Final[Registry[Any]] = Registry(
    "target motion",
    ("c", "w"),
    ("c", "w", "trackers"),
    ("c", "w", "trackers", "obstacles"),
    ("c", "w", "trackers", "obstacles", "s"),
)
