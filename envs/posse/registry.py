"""What every declaration has, and registries of declarations by name (:mod:`posse.declarations`)."""

from __future__ import annotations

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

from posse.numeric import compiled

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
        function: The function, compiled if kernels call it.
        kind: Name of the kind for messages, such as ``"reward term"``.
        allowed: The lists of parameters that the function may have.
        returns: What it returns.
        further: Names of further functions, each with its parameters and what it returns; ``None`` if it is not given.
    """

    name: str
    unit: str = ""
    meaning: str
    function: Function
    kind: ClassVar[str]
    allowed: ClassVar[tuple[Parameters, ...]]
    returns: ClassVar[str] = "a number"
    further: ClassVar[Mapping[str, tuple[Parameters, str]]] = {}

    def __post_init__(self) -> None:
        """Raise DeclarationError if an option is invalid."""

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

    def bounds(self, low: Bound, high: Bound, scenario: Any, of: str = "") -> list[float]:
        """Return the bounds ``of`` a value in a scenario; raise unless they are finite and in order."""
        values = []
        for name, bound in (("low", low), ("high", high)):
            try:
                value = bound(scenario) if callable(bound) else bound
            except Exception as error:  # a user's function
                raise self.error(f"{name}{of} in {scenario.name!r}: {error!r}") from error
            if not is_number(value):
                raise self.error(f"{name}={value!r}{of} in {scenario.name!r} is not a finite number")
            values.append(float(value))
        if values[0] > values[1]:
            raise self.error(f"low={values[0]:g}{of} is above high={values[1]:g} in {scenario.name!r}")
        return values

    def error(self, reason: str, function: Function | None = None) -> DeclarationError:
        """Return the error for an invalid declaration, or for one of its further functions."""
        return _error(self.kind, function or self.function, reason)


D = TypeVar("D", bound=Declaration)


class Registry(dict[str, D]):
    """Declarations of one kind by name, in order."""

    def __init__(self, make: type[D]) -> None:
        super().__init__()
        self.make = make
        self.kind = make.kind

    def decorator(self, first: object, **options: Any) -> Callable[[Function], Function]:
        """Return the decorator that declares a function; raise if the function is its first argument."""
        if callable(first):
            raise self._error(first, 'the decorator needs arguments: a unit, such as "1", or a name')
        return lambda function: self.declare(function, **options)

    def declare(self, function: Any, *, name: Any = None, **options: Any) -> Function:
        """Add the declaration made on a function, and return the function, compiled if kernels call it.

        It replaces one that was made on a function of the same module and qualified name.

        Args:
            function: The function.
            name: The declaration's name; default: that of the function.
            **options: Further attributes of the declaration.

        Raises:
            DeclarationError: The name is invalid or taken, a function has no docstring or other
                parameters, or an option is invalid.
        """
        self._check(function, *self.make.allowed)
        for further, (wanted, _) in self.make.further.items():
            if options[further] is not None:
                self._check(options[further], wanted)
                options[further] = compiled(plain(options[further]))
        name = plain(function).__name__ if name is None else name
        if not isinstance(name, str) or not name.replace("-", "_").isidentifier():
            raise self._error(function, f"invalid name {name!r}: use letters, digits, _ and -")
        taken = self.get(name)
        if taken is not None and _home(taken.function) != _home(function):
            raise self._error(function, f"the name {name!r} is taken by {place_of(taken.function)}")
        meaning = inspect.getdoc(plain(function)) or ""
        if not meaning.strip():
            raise self._error(function, "its docstring, which must state its meaning, is missing")
        unit = options.get("unit", "-")
        if not isinstance(unit, str) or not unit:
            raise self._error(function, f'unit={unit!r} must be a text, such as "m/s", or "1" for a plain number')
        working: Function = compiled(plain(function)) if parameters_of(function)[0] == "c" else function
        self[name] = self.make(name=name, meaning=meaning, function=working, **options)
        return working

    def _check(self, function: Any, *allowed: Parameters) -> None:
        """Raise DeclarationError unless a function has parameters allowed."""
        if not isinstance(plain(function), FunctionType):
            raise self._error(function, f"declare a function, made by def, not a {type(function).__name__}")
        signature = inspect.signature(plain(function))
        bare = [each.replace(annotation=each.empty) for each in signature.parameters.values()]
        given = str(signature.replace(parameters=bare, return_annotation=signature.empty))  # with * and defaults
        wanted = [f"({', '.join(each)})" for each in allowed]
        if given not in wanted:
            raise self._error(function, f"its parameters are {given}, not {' or '.join(wanted)}")

    def _error(self, function: Any, reason: str) -> DeclarationError:
        return _error(self.kind, function, reason)

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

    def __missing__(self, name: str) -> D:
        raise KeyError(f"{unknown(self.kind, name, self)}. To use a declaration of your own, import its module first")


def _error(kind: str, function: Any, reason: str) -> DeclarationError:
    return DeclarationError(f"{kind} {place_of(function)}: {reason}")


def _home(function: Function) -> tuple[str, str]:
    return plain(function).__module__, plain(function).__qualname__
