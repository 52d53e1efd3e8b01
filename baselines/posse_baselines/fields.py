"""Settings that declare themselves: unit, range, and whether tuning may change them."""

import dataclasses
from collections.abc import Mapping
from typing import Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np

from posse.declarations import unknown


class Tunable(NamedTuple):
    """A setting that a search may change, by the name of its field, and its value in the policy asked for.

    ``unit`` is empty for a plain number, ``above`` the name of a setting that it must exceed, or empty.
    """

    name: str
    default: float
    low: float
    high: float
    unit: str
    above: str


def number(default: float | None, unit: str, low: float, high: float) -> Any:
    """Declare a numeric field of a settings class, allowed in [low, high]; whole or ``None`` if its annotation says so.

    The unit is empty for a plain number.
    """
    return dataclasses.field(default=default, metadata={"unit": unit, "low": low, "high": high})


def tuned(default: float, unit: str, low: float, high: float, *, above: str = "") -> Any:
    """Declare a number that a search may change, and that must exceed the field named ``above`` if there is one."""
    return dataclasses.field(default=default, metadata={"unit": unit, "low": low, "high": high, "above": above})


def _text(number: float) -> str:
    return str(number) if isinstance(number, int) else f"{number:g}"


def check(settings: Any) -> None:
    """Raise ValueError if a field of a settings object has a value that its declaration does not allow."""
    hints = get_type_hints(type(settings))
    for field in dataclasses.fields(settings):
        name, value, meta, hint = field.name, getattr(settings, field.name), field.metadata, hints[field.name]
        if get_origin(hint) is Literal and value not in (choices := get_args(hint)):
            raise ValueError(f"{name}={value!r:.80} is unknown; known: {', '.join(choices)}")
        if hint is bool and not isinstance(value, bool):
            raise ValueError(f"{name}={value!r:.80} must be True or False")
        if "low" not in meta or (value is None and type(None) in get_args(hint)):
            continue
        whole = int in (hint, *get_args(hint))
        if isinstance(value, bool) or not isinstance(value, int if whole else (int, float)):
            raise ValueError(f"{name}={value!r} must be {'a whole number' if whole else 'a number'}")
        if not meta["low"] <= value <= meta["high"]:
            unit = f" {meta['unit']}" if meta["unit"] else ""
            raise ValueError(f"{name}={value!r} must lie in [{_text(meta['low'])}, {_text(meta['high'])}]{unit}")
        if (below := meta.get("above")) and not getattr(settings, below) < value:
            raise ValueError(f"{below}={getattr(settings, below)!r} must be below {name}={value!r}: a hysteresis")


def changed(settings: Any, values: Mapping[str, Any]) -> Any:
    """Return a settings object with some values changed; ValueError for an unknown name, or a value out of range."""
    names = [field.name for field in dataclasses.fields(settings)]
    for name in values:
        if name not in names:
            raise ValueError(unknown("setting", name, names))
    plain = {name: value.item() if isinstance(value, np.generic) else value for name, value in values.items()}
    return dataclasses.replace(settings, **plain)


def tunables(settings: Any) -> tuple[Tunable, ...]:
    """Return the tunable fields of a settings object, with its values as defaults."""
    return tuple(
        Tunable(field.name, getattr(settings, field.name), **field.metadata)
        for field in dataclasses.fields(settings)
        if "above" in field.metadata  # only `tuned` says it
    )
