"""What callers pass to a batch, checked before anything is changed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from posse.numeric import FloatArray
from posse.scenarios import ScenarioError
from posse.scenarios.shown import shown

MOST = 2**63
"""Seeds and numbers of worlds lie below."""


def check_count(name: str, value: object, least: int) -> int:
    """Return a whole number of at least ``least``.

    Raises:
        ScenarioError: It is none, or not below 2**63.
    """
    if not _is_whole(value) or not least <= value < MOST:  # type: ignore[operator]
        raise ScenarioError(
            f"{name}={shown(value)} must be a whole number, at least {least} and below 2**63"
        )
    return int(value)  # type: ignore[call-overload, no-any-return]


def check_seed(seed: object) -> int:
    """Return a seed.

    Raises:
        ScenarioError: It is no whole number in [0, 2**63).
    """
    if not _is_whole(seed) or not 0 <= seed < MOST:  # type: ignore[operator]
        raise ScenarioError(f"seed={shown(seed)} must be a whole number in [0, 2**63)")
    return int(seed)  # type: ignore[call-overload, no-any-return]


def _is_whole(value: object) -> bool:
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


def options_of(options: object) -> dict[str, Any]:
    """Return the options of a reset.

    Raises:
        ValueError: They are no mapping.
    """
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        raise ValueError(f"options must be a dictionary by name, or None, got {shown(options)}")
    return dict(options)


def as_array(name: str, value: object) -> npt.NDArray[Any]:
    """Return what was given as an array of any type.

    Raises:
        ValueError: It is none: rows of different lengths, say.
    """
    try:
        return np.asarray(value)
    except Exception:  # ValueError of numpy, or what a foreign object's own conversion raises
        raise ValueError(
            f"{name} must be an array, or nested lists of one length, got {shown(value)}"
        ) from None


def real_numbers(name: str, value: object) -> npt.NDArray[Any]:
    """Return what was given as an array of real numbers.

    Raises:
        ValueError: It holds anything else: complex numbers, texts, objects, truth values, whole
            numbers of more than 64 bits.
    """
    array = as_array(name, value)
    if array.dtype.kind not in "fiu":
        raise ValueError(
            f"{name} must be real numbers, got an array of {array.dtype}: {shown(value)}"
        )
    return array


def to_float32(array: npt.NDArray[Any]) -> FloatArray:
    """Return real numbers as float32; those that are too large for it become infinite."""
    with np.errstate(over="ignore"):
        return array.astype(np.float32)
