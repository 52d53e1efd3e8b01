"""Spaces of observations and actions, and checked conversion of user actions for the kernels.

An action is (speed, turn rate), each in [-1, 1], followed by the message. The `Discrete` variant
has three speeds by five turn rates.
"""

from __future__ import annotations

import reprlib
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from posse.engine.arguments import as_float32, in_box, real_numbers
from posse.engine.kernels import IN_BOX, bad_action
from posse.numeric import FloatArray
from posse.scenarios import Scenario, ScenarioError
from posse.signals.layout import ObservationLayout

SPEEDS: Final = (-1.0, 0.0, 1.0)
"""Discrete speeds: at rest, half, full."""
TURN_RATES: Final = (-1.0, -0.5, 0.0, 0.5, 1.0)
"""Discrete turn rates: maximum right to maximum left."""
MOTIONS: Final = np.array([(v, turn) for v in SPEEDS for turn in TURN_RATES], np.float32)
"""The discrete actions, (15, 2): number 5 i + j is speed i with turn rate j."""

Rows = int | slice
"""The robots that an agent moves, as rows of a batch: one, or all."""


def agent_names(scenario: Scenario) -> list[str]:
    """Return the agents' names in the order of their rows, ``tracker_0`` ..., ``target_0`` last."""
    names = [f"tracker_{i}" for i in range(scenario.num_trackers)]
    return names + ["target_0"] * (scenario.num_agents - scenario.num_trackers)


def box(low: npt.ArrayLike, high: npt.ArrayLike) -> spaces.Box:
    """Return a box of given bounds, float32.

    A constant entry (such as the team size) gets bounds slightly apart, since some tools divide by
    the width of a space.
    """
    low, high = np.asarray(low, np.float32), np.asarray(high, np.float32)
    apart = np.where(low == high, 1e-3 * np.maximum(1, np.abs(high)), 0).astype(np.float32)
    return spaces.Box(low - apart, high + apart, dtype=np.float32)


def single_action_space(scenario: Scenario, discrete: bool) -> spaces.Space[Any]:
    """Return the action space of one robot; ScenarioError for messages, which are not discrete."""
    if not isinstance(discrete, bool):
        raise ScenarioError(f"discrete_actions={reprlib.repr(discrete)} is not possible: it is True or False")
    if not discrete:
        return spaces.Box(-1.0, 1.0, (2 + scenario.message_size,), np.float32)
    if scenario.message_size:
        raise ScenarioError(
            f"discrete_actions=True cannot encode messages of message_size={scenario.message_size}: unset one of them"
        )
    return spaces.Discrete(len(MOTIONS))


def spaces_of(
    scenario: Scenario, rows: Rows, discrete: bool, silent: bool = False
) -> tuple[spaces.Box, spaces.Space[Any]]:
    """Return the spaces of an agent that moves some rows; ``silent``: without the message."""
    low, high = ObservationLayout(scenario).bounds()
    single = single_action_space(scenario.replace(message_size=0) if silent else scenario, discrete)
    if isinstance(rows, int):
        return box(low, high), single
    n = scenario.num_trackers
    team: spaces.Space[Any] = spaces.MultiDiscrete([len(MOTIONS)] * n)
    if not discrete:
        team = spaces.Box(-1.0, 1.0, (n, 2 + scenario.message_size), np.float32)
    return box(np.tile(low, (n, 1)), np.tile(high, (n, 1))), team


def as_motions(name: str, action: object, shape: tuple[int, ...] | None, discrete: bool) -> npt.NDArray[Any]:
    """Return an action of a shape as numbers, (..., 2 + m) float32, whose range is not checked; or ValueError."""
    array = real_numbers(name, action, "iu" if discrete else "fiu")
    if array.shape != shape:
        raise ValueError(f"{name} has shape {array.shape}, wanted {shape}")
    if not discrete:
        return as_float32(array)
    outside = (array < 0) | (array >= len(MOTIONS))
    if outside.any():
        where = f"[{', '.join(map(str, np.argwhere(outside)[0]))}]" if array.ndim else ""
        raise ValueError(f"{name}{where} is {array[outside][0]}, outside 0 to {len(MOTIONS) - 1}")
    motions: FloatArray = MOTIONS[array]
    return motions


class ActionReader:
    """Converts the actions of one world to the kernels' array.

    Args:
        agents: Names of the robots that act, by row.
        space: Space of an action that is read: of all robots (:meth:`of_all`), or of one
            (:meth:`by_agent`).
        clip: Whether finite numbers outside [-1, 1] are clipped instead of refused.

    Attributes:
        read: The last actions, (1, rows, 2 + m) float32; always the same array.
    """

    def __init__(self, agents: Sequence[str], space: spaces.Space[Any], clip: bool) -> None:
        assert space.shape is not None
        self._agents, self._space, self._clip = list(agents), space, clip
        self._shape = space.shape
        self._discrete = not isinstance(space, spaces.Box)
        length = 2 if self._discrete else space.shape[-1]
        self.read: FloatArray = np.zeros((1, len(agents), length), np.float32)
        self._plane: FloatArray = self.read[0]
        self._usual = None if self._discrete else self.read.dtype
        self._rows = [(agent, memoryview(row)) for agent, row in zip(agents, self._plane, strict=True)]

    def __reduce__(self) -> tuple[Any, ...]:
        # Rebuilt, so that the rows are views of the new array.
        return ActionReader, (self._agents, self._space, self._clip)

    def of_all(self, action: Any) -> None:
        """Read one action of all robots; ValueError if it is out of the space."""
        usual = type(action) is np.ndarray and action.dtype is self._usual and action.shape == self._shape
        # The usual case needs no conversion, which takes as long as the rest.
        self._plane[...] = action if usual else as_motions("action", action, self._shape, self._discrete)
        self._check()

    def by_agent(self, actions: Mapping[str, Any]) -> None:
        """Read the actions of a dictionary by agent; ValueError if one is missing, unknown or out of the space."""
        # Assignment to a memoryview checks type and shape faster than explicit tests.
        try:
            if type(actions) is not dict or self._discrete or len(actions) != len(self._rows):
                raise TypeError
            for agent, row in self._rows:
                row[:] = actions[agent]
        except (KeyError, TypeError, ValueError, BufferError):
            self._by_agent(actions)
        self._check()

    def _by_agent(self, actions: Mapping[str, Any]) -> None:
        """Read the actions, and report which one is invalid."""
        if not isinstance(actions, Mapping):
            raise ValueError(f"actions must be a dictionary by agent, got {type(actions).__name__}")
        known = f"agents are: {', '.join(self._agents)}"
        for agent in actions:
            if agent not in self._agents:
                raise ValueError(f"action for unknown agent {reprlib.repr(agent)}; {known}")
        for agent, row in zip(self._agents, self._plane, strict=True):
            if agent not in actions:
                raise ValueError(f"no action for {agent}: every agent needs one; {known}")
            row[...] = as_motions(f"action of {agent}", actions[agent], self._shape, self._discrete)

    def _check(self) -> None:
        if bad_action(self.read) != IN_BOX:
            self.read[...] = in_box(self.read, self._clip, self._place)

    def _place(self, _: int, row: int, k: int) -> str:
        parts = ("speed", "turn rate")
        return f"action of {self._agents[row]}: {parts[k] if k < 2 else f'message[{k - 2}]'}"
