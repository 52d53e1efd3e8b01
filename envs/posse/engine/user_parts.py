"""Errors in functions that users' modules declare, reported by function and line."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from typing import Any, Final

import numba
import numpy as np

from posse.engine.kernels import Tables
from posse.numeric import UNCOMPILED, Records
from posse.numeric.compiler.complaints import Complaint, unknown_attribute, why_not_compiled
from posse.numeric.simd.lane_code import tuple_of_lanes
from posse.registry import DeclarationError, Function, Registry
from posse.rules.state import CONFIG, TRACKER, WorldArrays
from posse.signals.observation.views import Mate, View
from posse.signals.parts import Parts, added

typeof: Final[Any] = numba.typeof


def check_fields(parts: Parts, worlds: WorldArrays) -> None:
    """Raise if a user's function accesses a field that a record lacks.

    Raises:
        DeclarationError: Names the function, the line and the field.
    """
    fields = {
        "c": CONFIG.names or (),
        "w": worlds.world.dtype.names or (),
        "t": TRACKER.names or (),
        "v": View._fields,
        "m": Mate._fields,
    }
    for registry, function, _ in _functions(parts):
        _raise(registry, function, unknown_attribute(function, fields))


def check_functions(parts: Parts, tables: Tables, worlds: WorldArrays, scratch: Records) -> None:
    """Raise if a user's function cannot be compiled. Takes some tenths of a second for each.

    Raises:
        DeclarationError: Names the function, the line and the reason.
    """
    if UNCOMPILED:
        return
    tracker = np.zeros(1, TRACKER)
    examples: dict[str, Any] = {
        "c": tables.config[0],
        "w": worlds.world[0],
        "t": tracker[0],
        "trackers": tracker,
        "obstacles": worlds.obstacle[0],
        "slots": tables.slots,
        "s": scratch[0],
        "number": 0,
        "dx": np.float32(0),
        "dy": np.float32(0),
    }
    types = {name: typeof(example) for name, example in examples.items()}
    types |= {"v": tuple_of_lanes(View), "m": tuple_of_lanes(Mate)}
    for registry, function, returns in _functions(parts):
        names = inspect.signature(function).parameters
        if all(name in types for name in names):
            arguments = [types[name] for name in names]
            _raise(registry, function, why_not_compiled(function, arguments, returns))


def _functions(parts: Parts) -> Iterator[tuple[Registry[Any], Function, str]]:
    for registry, thing in added(parts):
        for function, returns in thing.functions:
            yield registry, function, returns


def _raise(registry: Registry[Any], function: Function, complaint: Complaint | None) -> None:
    if complaint is not None:
        error: DeclarationError = registry.error(function, f"line {complaint.line}: {complaint.reason}")
        raise error from None
