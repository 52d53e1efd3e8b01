"""Registries of declarations by name: observation fields, reward terms, metrics, ...

A registry holds the declarations of one kind in order. Those of posse's own modules are *built in*
and apply to every world. Those of a user's module are available after its import, and a scenario
selects them by name.
"""

from __future__ import annotations

import difflib
import inspect
import os
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final, Generic, TypeVar

from posse.shown import shown

T = TypeVar("T")
Function = Callable[..., Any]

_PACKAGE: Final = __name__.partition(".")[0]


class DeclarationError(ValueError):
    """An invalid declaration. The message names the function, its file and line."""


def place_of(function: Function) -> str:
    """Return a function's name, file and line, for messages."""
    code = getattr(function, "py_func", function).__code__
    return f"{function.__name__} ({os.path.relpath(code.co_filename)}:{code.co_firstlineno})"


class Registry(Mapping[str, T], Generic[T]):
    """Declarations of one kind by name, in order.

    Args:
        kind: Name of the kind for messages, such as ``"reward term"``.
    """

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self._things: dict[str, T] = {}
        self._functions: dict[str, Function] = {}

    def add(self, name: str, thing: T, function: Function) -> None:
        """Add a declaration and the function that it is made on.

        Raises:
            DeclarationError: The name is invalid or taken, or the function has no docstring.
        """
        if not name.replace("-", "_").isidentifier():
            raise self.error(function, f"invalid name {shown(name)}: use letters, digits, _ and -")
        taken = self._functions.get(name)
        if taken is not None:
            raise self.error(function, f"the name {name!r} is taken by {place_of(taken)}")
        if not (function.__doc__ or "").strip():
            raise self.error(function, "its docstring, which must state its meaning, is missing")
        self._things[name], self._functions[name] = thing, function

    def error(self, function: Function, reason: str) -> DeclarationError:
        """Return the error for an invalid declaration."""
        return DeclarationError(f"{self.kind} {place_of(function)}: {reason}")

    def check_parameters(self, function: Function, allowed: tuple[str, ...], least: int | None = None) -> None:
        """Check a function's parameter names: all of ``allowed``, or at least the first few.

        Args:
            function: The declared function.
            allowed: Parameter names in order.
            least: Minimum number of parameters; default: all.

        Raises:
            DeclarationError: The parameters differ.
        """
        names = tuple(inspect.signature(function).parameters)
        least = len(allowed) if least is None else least
        if len(names) < least or names != allowed[: len(names)]:
            wanted = f"({', '.join(allowed)})"
            if least < len(allowed):
                wanted += f" or the first {least} or more of them"
            raise self.error(function, f"its parameters are ({', '.join(names)}), not {wanted}")

    def is_built_in(self, name: str) -> bool:
        """Return whether posse itself declares this name."""
        return self._functions[name].__module__.partition(".")[0] == _PACKAGE

    def built_in(self) -> tuple[T, ...]:
        """Return the built-in declarations, in order."""
        return tuple(thing for name, thing in self._things.items() if self.is_built_in(name))

    def with_added(self, *names: str) -> tuple[T, ...]:
        """Return the built-in declarations, then the named ones, each once.

        Raises:
            KeyError: An unknown name; the message suggests similar ones.
        """
        added = dict.fromkeys(names)
        return (*self.built_in(), *(self[name] for name in added if name not in self or not self.is_built_in(name)))

    def unknown(self, name: object) -> str:
        """Return the message for an unknown name."""
        near = difflib.get_close_matches(shown(name), self._things, n=3)
        hint = f" (did you mean {' or '.join(map(repr, near))}?)" if near else ""
        known = ", ".join(self._things) or "none"
        return (
            f"unknown {self.kind} {shown(name)}{hint}; known: {known}. "
            "To use a declaration of your own, import its module first"
        )

    def __getitem__(self, name: str) -> T:
        if name not in self._things:
            raise KeyError(self.unknown(name))
        return self._things[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._things)

    def __len__(self) -> int:
        return len(self._things)


FIELDS: Final[Registry[Any]] = Registry("observation field")
"""Values are :class:`posse.signals.observation.fields.FieldDeclaration`."""
METRICS: Final[Registry[Any]] = Registry("metric")
"""Values are :class:`posse.signals.measuring.Metric`."""
REWARD_TERMS: Final[Registry[Any]] = Registry("reward term")
"""Values are :class:`posse.signals.reward.RewardTerm`."""
SENSORS: Final[Registry[Any]] = Registry("sensor")
"""Values are :class:`posse.rules.senses.declaring.Sensor`."""
TARGET_MOTIONS: Final[Registry[Any]] = Registry("target motion")
"""Values are :class:`posse.rules.targets.declaring.TargetMotion`."""
