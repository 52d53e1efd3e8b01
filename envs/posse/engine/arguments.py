"""Checks of the arguments of a batch, before anything is changed."""

import reprlib
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse.numeric import ONE, WIDTH, BoolArray, FloatArray, kernel
from posse.numeric.lanes import ALL, bits, load
from posse.scenarios import Scenario

MOST_ACTION: Final = np.float32(1 + 1e-6)
"""Actions up to this are clipped to 1, since rounding may exceed it."""
_FLOAT32: Final = np.dtype(np.float32)


def options_of(options: object) -> dict[str, Any]:
    """Return the options of a reset as a dictionary, or raise ValueError."""
    if options is not None and not isinstance(options, Mapping):
        raise ValueError(f"options must be a dictionary by name, or None, got {reprlib.repr(options)}")
    return dict(options or {})


def mask_of(options: Mapping[str, Any], num_worlds: int) -> BoolArray:
    """Return which worlds a reset with these options starts, (E,), or raise ValueError."""
    mask = options.get("reset_mask")
    chosen = np.ones(num_worlds, np.bool_) if mask is None else np.asarray(mask)
    if chosen.dtype != np.bool_ or chosen.shape != (num_worlds,):
        raise ValueError(
            f"reset_mask must be a bool array of shape ({num_worlds},), got {chosen.dtype} of shape {chosen.shape}"
        )
    return chosen


def real_numbers(
    name: str, value: object, shape: tuple[int, ...] | None = None, kinds: str = "fiu"
) -> npt.NDArray[Any]:
    """Return a value as an array of a shape, of real numbers or whole ones (``kinds="iu"``), or raise ValueError."""
    try:
        array = np.asarray(value)
    except Exception:  # numpy's ValueError, or any error of a foreign object's conversion
        raise ValueError(f"{name} is not an array: {reprlib.repr(value)}") from None
    if array.dtype.kind not in kinds:
        wanted = "real numbers" if "f" in kinds else "whole numbers"
        raise ValueError(f"{name} must be {wanted}, got {reprlib.repr(value)} ({array.dtype})")
    if shape is not None and array.shape != shape:
        raise ValueError(f"{name} has shape {array.shape}, wanted {shape}")
    return array


def as_float32(name: str, value: object, shape: tuple[int, ...] | None = None) -> FloatArray:
    """Return :func:`real_numbers` as contiguous float32; numbers out of its range become infinite."""
    if type(value) is np.ndarray and value.dtype is _FLOAT32 and value.shape == shape and value.flags.c_contiguous:
        return value  # the usual case, which the checks would take as long as the rest
    array = real_numbers(name, value, shape)
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(array, np.float32)


@kernel
def all_in_box(actions: FloatArray) -> bool:
    """Return whether all actions are in [-1, 1]."""
    flat, inside = actions.reshape(-1), True
    whole = len(flat) // WIDTH * WIDTH
    for k in range(0, whole, WIDTH):
        inside &= bits(abs(load(flat, k)) <= ONE) == ALL
    for k in range(whole, len(flat)):
        inside &= abs(flat[k]) <= ONE
    return inside


def in_box(actions: FloatArray, clip: bool, place: Callable[..., str] = "actions[{}, {}, {}]".format) -> FloatArray:
    """Return actions (E, rows, 2 + m) in [-1, 1]; others raise ValueError, or are clipped if they are finite.

    Numbers outside by rounding are always clipped. ``place(e, i, k)`` names an element in the message.
    """
    if all_in_box(actions):
        return actions
    allowed = np.isfinite(actions) if clip else np.abs(actions) <= MOST_ACTION
    if not allowed.all():
        e, i, k = np.argwhere(~allowed)[0]
        fix = "it must be finite" if clip else "scale or clip the policy's output (environments: clip_actions=True)"
        raise ValueError(f"{place(e, i, k)} = {actions[e, i, k]} is not a number in [-1, 1]: {fix}")
    return actions.clip(-1, 1)


def poses_of(options: Mapping[str, Any], scenario: Scenario, num_worlds: int) -> dict[str, npt.NDArray[np.float64]]:
    """Return the start poses among the options of a reset, (E, N, 3) and (E, 3), or raise ValueError."""
    poses, (most_x, most_y) = {}, scenario.start_extent
    for name, shape in (("tracker_pose", (scenario.num_trackers, 3)), ("target_pose", (3,))):
        if options.get(name) is None:
            continue
        array, full = real_numbers(name, options[name]).astype(np.float64), (num_worlds, *shape)
        if array.shape not in (shape, full, (3,) if scenario.num_trackers == 1 else full):
            raise ValueError(f"{name} has shape {array.shape}, wanted {shape} or {full}: (x, y, θ) each")
        if not (np.isfinite(array).all() and (np.abs(array[..., :2]) <= scenario.start_extent).all()):
            raise ValueError(
                f"{name}={reprlib.repr(options[name])} must be finite, and in {scenario.name!r} x lies within "
                f"±{most_x:g} m and y within ±{most_y:g} m"
            )
        poses[name] = np.broadcast_to(array, full)
    return poses
