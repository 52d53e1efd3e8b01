"""Spaces of observations and actions, and actions as numbers.

An action is (speed, turn rate), each in [-1, 1], followed by the message. The `Discrete` variant
has three speeds by five turn rates.
"""

import itertools
import reprlib
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from posse.engine.arguments import as_float32, real_numbers
from posse.engine.batch import Batch
from posse.numeric import FloatArray
from posse.scenarios import ScenarioError

MOTIONS: Final = np.array(list(itertools.product((-1, 0, 1), (-1, -0.5, 0, 0.5, 1))), np.float32)
"""The discrete actions, (15, 2): number 5 i + j is speed i (rest, half, full) with turn rate j (right to left)."""


def agent_names(batch: Batch) -> list[str]:
    """Return the agents' names in the order of the batch's rows, ``tracker_0`` ..., ``target_0`` last."""
    trackers = (f"tracker_{i}" for i in range(batch.scenario.num_trackers))
    return [*trackers, "target_0"][: batch.action_shape[1]]


def box(low: npt.ArrayLike, high: npt.ArrayLike) -> spaces.Box:
    """Return a box of given bounds, float32.

    A constant entry (such as the team size) gets bounds slightly apart, since some tools divide by
    the width of a space.
    """
    low, high = np.asarray(low, np.float32), np.asarray(high, np.float32)
    apart = np.where(low == high, 1e-3 * np.maximum(1, np.abs(high)), 0).astype(np.float32)
    return spaces.Box(low - apart, high + apart, dtype=np.float32)


def single_action_space(message_size: int, discrete: bool) -> spaces.Space[Any]:
    """Return the action space of one robot; ScenarioError for messages, which are not discrete."""
    if not isinstance(discrete, bool):
        raise ScenarioError(f"discrete_actions={reprlib.repr(discrete)} is not possible: it is True or False")
    if not discrete:
        return spaces.Box(-1.0, 1.0, (2 + message_size,), np.float32)
    if message_size:
        raise ScenarioError(f"discrete_actions=True cannot encode messages of message_size={message_size}: unset one")
    return spaces.Discrete(len(MOTIONS))


def as_motions(name: str, action: object, shape: tuple[int, ...] | None, discrete: bool) -> FloatArray:
    """Return an action of a shape as numbers, (..., 2 + m) float32, whose range is not checked; or ValueError."""
    if not discrete:
        return as_float32(name, action, shape)
    array = real_numbers(name, action, shape, "iu")
    outside = (array < 0) | (array >= len(MOTIONS))
    if outside.any():
        where = f"[{', '.join(map(str, np.argwhere(outside)[0]))}]" if array.ndim else ""
        raise ValueError(f"{name}{where} is {array[outside][0]}, outside 0 to {len(MOTIONS) - 1}")
    return MOTIONS.take(array, axis=0)
