"""What is declared by name, here or in a user's own module: observation fields, reward terms, ...

A registry keeps one kind of thing in the order of declaration. What posse's own modules declare is
*built in*: every world has it. What a user's module declares is there once that module has been
imported, and a scenario asks for it by name.
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
    """A declared function that cannot be used. The message names it, and the line it stands in."""


def place_of(function: Function) -> str:
    """Return a function's name, file and line, for messages."""
    code = getattr(function, "py_func", function).__code__
    return f"{function.__name__} ({os.path.relpath(code.co_filename)}:{code.co_firstlineno})"


class Registry(Mapping[str, T], Generic[T]):
    """Things of one kind by name, in the order in which they were declared.

    Args:
        kind: What they are, for messages: ``"reward term"``.
    """

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self._things: dict[str, T] = {}
        self._functions: dict[str, Function] = {}

    def add(self, name: str, thing: T, function: Function) -> None:
        """Add what a function declares.

        Raises:
            DeclarationError: The name is taken, or the function has no docstring.
        """
        if not name.replace("-", "_").isidentifier():
            raise self.error(function, f"{shown(name)} is no name: use letters, digits, _ and -")
        taken = self._functions.get(name)
        if taken is not None:
            raise self.error(function, f"the name {name!r} is taken by {place_of(taken)}")
        if not (function.__doc__ or "").strip():
            raise self.error(function, "its docstring, which says what it means, is missing")
        self._things[name], self._functions[name] = thing, function

    def error(self, function: Function, reason: str) -> DeclarationError:
        """Return the error that a declared function cannot be used."""
        return DeclarationError(f"{self.kind} {place_of(function)}: {reason}")

    def check_parameters(
        self, function: Function, allowed: tuple[str, ...], least: int | None = None
    ) -> None:
        """Raise unless a function's parameters are those allowed, or the first ``least`` or more.

        Raises:
            DeclarationError: They are others.
        """
        names = tuple(inspect.signature(function).parameters)
        least = len(allowed) if least is None else least
        if len(names) < least or names != allowed[: len(names)]:
            wanted = f"({', '.join(allowed)})"
            if least < len(allowed):
                wanted += f" or the first {least} or more of them"
            raise self.error(function, f"its parameters are ({', '.join(names)}), not {wanted}")

    def is_built_in(self, name: str) -> bool:
        """Say whether posse itself declares it."""
        return self._functions[name].__module__.partition(".")[0] == _PACKAGE

    def built_in(self) -> tuple[T, ...]:
        """Return what posse itself declares, in order."""
        return tuple(thing for name, thing in self._things.items() if self.is_built_in(name))

    def with_added(self, *names: str) -> tuple[T, ...]:
        """Return what posse itself declares, then what is asked for by name beside it.

        Raises:
            KeyError: Nothing of a name has been declared; the message has near names.
        """
        added = dict.fromkeys(names)  # each once
        return (
            *self.built_in(),
            *(self[name] for name in added if name not in self or not self.is_built_in(name)),
        )

    def unknown(self, name: object) -> str:
        """Return the message that nothing of this name has been declared."""
        near = difflib.get_close_matches(shown(name), self._things, n=3)
        hint = f" (did you mean {' or '.join(map(repr, near))}?)" if near else ""
        known = ", ".join(self._things) or "none"
        return (
            f"unknown {self.kind} {shown(name)}{hint}; known: {known}. "
            "One of your own is known once its module has been imported"
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
"""Of :class:`posse.signals.observation.fields.FieldDeclaration`."""
METRICS: Final[Registry[Any]] = Registry("metric")
"""Of :class:`posse.signals.measuring.Metric`."""
REWARD_TERMS: Final[Registry[Any]] = Registry("reward term")
"""Of :class:`posse.signals.reward.RewardTerm`."""
SENSORS: Final[Registry[Any]] = Registry("sensor")
"""Of :class:`posse.rules.senses.declaring.Sensor`."""
TARGET_MOTIONS: Final[Registry[Any]] = Registry("target motion")
"""Of :class:`posse.rules.targets.declaring.TargetMotion`."""
