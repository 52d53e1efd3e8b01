"""Validation of the arguments of a batch, before anything is changed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse.numeric import BoolArray, FloatArray
from posse.rules.state import SPLITS
from posse.scenarios import ScenarioError
from posse.scenarios.setting import is_one_of
from posse.shown import shown

AUTORESET_MODES: Final = ("next_step", "same_step", "disabled")
MOST = 2**63
"""Seeds and numbers of worlds must be below."""


def check_count(name: str, value: object, least: int) -> int:
    """Return a whole number in [least, 2**63).

    Raises:
        ScenarioError: The value is not a whole number, or out of range.
    """
    if not _is_whole(value) or not least <= value < MOST:  # type: ignore[operator]
        raise ScenarioError(f"{name}={shown(value)} must be a whole number, at least {least} and below 2**63")
    return int(value)  # type: ignore[call-overload, no-any-return]


def check_seed(seed: object) -> int:
    """Return a seed.

    Raises:
        ScenarioError: The value is not a whole number in [0, 2**63).
    """
    if not _is_whole(seed) or not 0 <= seed < MOST:  # type: ignore[operator]
        raise ScenarioError(f"seed={shown(seed)} must be a whole number in [0, 2**63)")
    return int(seed)  # type: ignore[call-overload, no-any-return]


def _is_whole(value: object) -> bool:
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


def options_of(options: object) -> dict[str, Any]:
    """Return the options of a reset.

    Raises:
        ValueError: They are not a mapping.
    """
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        raise ValueError(f"options must be a dictionary by name, or None, got {shown(options)}")
    return dict(options)


def as_array(name: str, value: object) -> npt.NDArray[Any]:
    """Return a value as an array of any type.

    Raises:
        ValueError: It is not an array: its rows differ in length, for instance.
    """
    try:
        return np.asarray(value)
    except Exception:  # numpy's ValueError, or any error of a foreign object's conversion
        raise ValueError(f"{name} must be an array, or nested lists of one length, got {shown(value)}") from None


def real_numbers(name: str, value: object) -> npt.NDArray[Any]:
    """Return a value as an array of real numbers.

    Raises:
        ValueError: It holds anything else: complex numbers, strings, objects, booleans, integers of
            more than 64 bits.
    """
    array = as_array(name, value)
    if array.dtype.kind not in "fiu":
        raise ValueError(f"{name} must be real numbers, got an array of {array.dtype}: {shown(value)}")
    return array


def to_float32(array: npt.NDArray[Any]) -> FloatArray:
    """Return real numbers as float32; numbers out of its range become infinite."""
    with np.errstate(over="ignore"):
        return array.astype(np.float32)


def check_mask(mask: npt.ArrayLike | None, num_worlds: int) -> BoolArray:
    """Return which worlds a mask selects, (E,); all worlds if it is None."""
    if mask is None:
        return np.ones(num_worlds, np.bool_)
    array = as_array("reset_mask", mask)
    if array.dtype != np.bool_ or array.shape != (num_worlds,):
        raise ValueError(
            f"reset_mask must be a bool array of shape ({num_worlds},), got {array.dtype} of shape {array.shape}"
        )
    return array


def action_error(index: tuple[int, int, int], value: np.float32) -> ValueError:
    """Return the error for actions[index]."""
    e, i, k = index
    return ValueError(
        f"actions[{e}, {i}, {k}] = {value} is not a number in [-1, 1]: scale or clip the policy's output first"
    )


def check_array(name: str, array: object, shape: tuple[int, ...]) -> None:
    """Raise if an array is not as compiled code assumes without checking."""
    if not isinstance(array, np.ndarray):
        raise ValueError(f"{name} must be a numpy array, got {type(array).__name__}")
    if array.dtype != np.float32 or array.shape != shape or not array.flags.carray:
        raise ValueError(
            f"{name} must be a contiguous, writable float32 array of shape {shape}, got "
            f"{array.dtype} of shape {array.shape} with strides {array.strides}"
            + ("" if array.flags.writeable else ", not writable")
        )


def check_settings(num_worlds: int, first_world: int, split: str, autoreset: str, num_threads: int | None) -> None:
    """Raise ScenarioError if these settings of a batch are invalid."""
    num_worlds = check_count("num_worlds", num_worlds, 1)
    first_world = check_count("first_world", first_world, 0)
    if first_world + num_worlds > MOST:
        raise ScenarioError(
            f"first_world={first_world} and num_worlds={num_worlds} go beyond world 2**63 - 1: lower first_world"
        )
    if num_threads is not None:
        check_count("num_threads", num_threads, 1)
    if not is_one_of(SPLITS, split):
        raise ScenarioError(f"unknown split {shown(split)}; splits are: {', '.join(SPLITS)}")
    if not is_one_of(AUTORESET_MODES, autoreset):
        raise ScenarioError(f"unknown autoreset mode {shown(autoreset)}; modes are: " + ", ".join(AUTORESET_MODES))
