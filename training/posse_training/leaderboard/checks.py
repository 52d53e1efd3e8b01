"""Checks of values from a file that anyone may have written; each raises ``ValueError``."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from typing import Any

Check = Callable[[str, Any], None]
"""Takes a value's name and the value."""


def keys(given: Any, wanted: Iterable[str]) -> None:
    """Check that an object has these keys and no other."""
    if not isinstance(given, dict):
        raise ValueError(f"{given!r:.60} is not an object")
    names = set(wanted)
    for what, found in (("lacks", names - given.keys()), ("has the unknown", given.keys() - names)):
        if found:
            raise ValueError(f"it {what} {', '.join(sorted(repr(name)[:40] for name in found))}")


def text(longest: int) -> Check:
    """Return a check of a printable text of 1 to ``longest`` characters."""

    def check(name: str, value: Any) -> None:
        if not (isinstance(value, str) and 0 < len(value) <= longest and value.isprintable()):
            raise ValueError(f"{name}={value!r:.60} must be a printable text of 1 to {longest} characters")

    return check


def matching(pattern: str, allowed: str) -> Check:
    """Return a check of a text that a pattern describes."""
    compiled = re.compile(pattern)

    def check(name: str, value: Any) -> None:
        if not (isinstance(value, str) and len(value) <= 400 and compiled.fullmatch(value)):
            raise ValueError(f"{name}={value!r:.60} must be {allowed}")

    return check


def one_of(*choices: str) -> Check:
    """Return a check of a text that is one of some."""

    def check(name: str, value: Any) -> None:
        if not isinstance(value, str) or value not in choices:
            raise ValueError(f"{name}={value!r:.60} must be one of {', '.join(choices)}")

    return check


def optional(other: Check) -> Check:
    """Return a check of a value that may be null."""

    def check(name: str, value: Any) -> None:
        if value is not None:
            other(name, value)

    return check


def whole(low: int, high: int) -> Check:
    """Return a check of a whole number in [low, high]."""

    def check(name: str, value: Any) -> None:
        if type(value) is not int or not low <= value <= high:
            raise ValueError(f"{name}={value!r:.60} must be a whole number in [{low}, {high}]")

    return check


def flag(name: str, value: Any) -> None:
    """Check a truth value."""
    if not isinstance(value, bool):
        raise ValueError(f"{name}={value!r:.60} must be true or false")


def shares(name: str, values: Any, most: int, digits: int) -> None:
    """Check a list of 1 to ``most`` numbers in [0, 1] of at most ``digits`` decimals."""
    if not isinstance(values, list) or not 1 <= len(values) <= most:
        raise ValueError(f"{name} must be a list of 1 to {most:,} numbers")
    for world, value in enumerate(values):
        if type(value) not in (int, float) or not 0 <= value <= 1 or round(value, digits) != value:
            raise ValueError(
                f"{name}={value!r:.60} in world {world} must be a number in [0, 1] of at most {digits} decimals"
            )
