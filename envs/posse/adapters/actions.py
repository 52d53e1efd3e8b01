"""Action spaces, and checked conversion of user actions for the kernels.

An action is (speed, turn rate), each in [-1, 1], followed by the message. The `Discrete` variant
has three speeds by five turn rates.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from posse.engine.arguments import to_float32
from posse.engine.kernels import TO_CLIP, bad_action
from posse.numeric import FloatArray, direct
from posse.scenarios import Scenario, ScenarioError
from posse.shown import shown

SPEEDS: Final = (-1.0, 0.0, 1.0)
"""Discrete speeds: at rest, half, full."""
TURN_RATES: Final = (-1.0, -0.5, 0.0, 0.5, 1.0)
"""Discrete turn rates: maximum right to maximum left."""
MOTIONS: Final = np.array([(v, turn) for v in SPEEDS for turn in TURN_RATES], np.float32)
"""The discrete actions, (15, 2): number 5 i + j is speed i with turn rate j."""

_PARTS: Final = ("speed", "turn rate")
_FLOAT32: Final = np.dtype(np.float32)


def agent_names(scenario: Scenario) -> list[str]:
    """Return the agents' names in the order of their rows, ``tracker_0`` ..., ``target_0`` last."""
    names = [f"tracker_{i}" for i in range(scenario.num_trackers)]
    return names + ["target_0"] * (scenario.num_agents - scenario.num_trackers)


def single_action_space(scenario: Scenario, discrete: bool) -> spaces.Space[Any]:
    """Return the action space of one robot.

    Raises:
        ScenarioError: ``discrete`` with messages, which are not discrete.
    """
    if not isinstance(discrete, bool):
        raise ScenarioError(f"discrete_actions={shown(discrete)} is not possible: it is True or False")
    if not discrete:
        return spaces.Box(-1.0, 1.0, (2 + scenario.message_size,), np.float32)
    if scenario.message_size:
        raise ScenarioError(
            f"discrete_actions=True cannot encode messages of message_size={scenario.message_size}: unset one of them"
        )
    return spaces.Discrete(len(MOTIONS))


class ActionReader:
    """Converts user actions to the kernels' array.

    Args:
        scenario: Scenario of the worlds.
        discrete: Whether each action is the number of one of :data:`MOTIONS`.
        agents: Names of the agents that act; default: all.

    Attributes:
        read: The last actions, (1, rows, 2 + m) float32; always the same array.
    """

    def __init__(self, scenario: Scenario, discrete: bool, agents: Sequence[str] | None = None) -> None:
        self._scenario = scenario
        self._agents = agent_names(scenario) if agents is None else list(agents)
        self._discrete = discrete
        rows = len(self._agents)
        self._shape = (rows,) if discrete else (rows, 2 + scenario.message_size)
        self.read: FloatArray = np.zeros((1, rows, 2 + scenario.message_size), np.float32)
        self._plane: FloatArray = self.read[0]
        self._rows = [(a, memoryview(row)) for a, row in zip(self._agents, self._plane, strict=True)]
        self._first_bad = self._first_bad_of_all

    def __reduce__(self) -> tuple[Any, ...]:
        # Rebuilt, so that the rows are views of the new array.
        return ActionReader, (self._scenario, self._discrete, self._agents)

    def by_agent(self, actions: Mapping[str, Any]) -> None:
        """Read the actions of a dictionary by agent.

        Raises:
            ValueError: An agent is missing or unknown, or its action is of a wrong type or shape,
                not finite, or outside the space; the message names agent and value.
        """
        if type(actions) is dict and len(actions) == len(self._rows) and not self._discrete:
            # The usual case, a float32 array for each agent. Assignment to a memoryview checks type
            # and shape faster than explicit tests.
            try:
                for agent, row in self._rows:
                    row[:] = actions[agent]
            except (KeyError, TypeError, ValueError, BufferError):
                pass
            else:
                position = self._first_bad(self.read)
                if position == TO_CLIP:
                    np.clip(self.read, -1, 1, out=self.read)
                if position < 0:
                    return
        self._by_agent_slowly(actions)

    def by_row(self, actions: npt.ArrayLike) -> None:
        """Read the actions of an array (rows, 2 + m), or (rows,) of discrete ones.

        Raises:
            ValueError: As :meth:`by_agent`.
        """
        array = actions if type(actions) is np.ndarray else _as_array(actions, "action")
        if array.shape != self._shape:
            raise ValueError(f"action has shape {array.shape}, wanted {self._shape}")
        if array.dtype is _FLOAT32 and not self._discrete:
            self._plane[...] = array
            position = self._first_bad(self.read)
            if position == TO_CLIP:
                np.clip(self.read, -1, 1, out=self.read)
            if position < 0:
                return
        if not (self._discrete and array.dtype.kind in "iu"):
            for agent, row in zip(self._agents, array, strict=True):
                self._row(agent, row)
        self.read[...] = self._in_space(array, self._agents)

    def one(self, agent: str, action: npt.ArrayLike) -> FloatArray:
        """Return the action of one agent, checked, (2 + m,).

        Raises:
            ValueError: As :meth:`by_agent`.
        """
        array = self._row(agent, action)
        checked: FloatArray = self._in_space(array[None], (agent,))[0, 0]
        return checked

    def _first_bad_of_all(self, actions: FloatArray) -> int:
        """Check the actions; later calls use the resolved kernel directly."""
        position = bad_action(actions)
        self._first_bad = direct(bad_action)
        return position

    def _by_agent_slowly(self, actions: Mapping[str, Any]) -> None:
        """Read the actions with full checks, and report which one is invalid."""
        if not isinstance(actions, Mapping):
            raise ValueError(f"actions must be a dictionary by agent, got {type(actions).__name__}")
        known = f"agents are: {', '.join(self._agents)}"
        for agent in actions:
            if agent not in self._agents:
                raise ValueError(f"action for unknown agent {shown(agent)}; {known}")
        for agent in self._agents:
            if agent not in actions:
                raise ValueError(f"no action for {agent}: every agent needs one; {known}")
        rows = [self._row(agent, actions[agent]) for agent in self._agents]
        self.read[...] = self._in_space(np.stack(rows), self._agents)

    def _row(self, agent: str, action: npt.ArrayLike) -> npt.NDArray[Any]:
        """Return one agent's action as an array of the right type and shape."""
        array = _as_array(action, f"action of {agent}")
        wanted = "iu" if self._discrete else "fiu"
        if array.dtype.kind not in wanted:
            kind = "a whole number" if self._discrete else "real numbers"
            raise ValueError(f"action of {agent} must be {kind}, got {shown(action)} ({array.dtype})")
        if array.shape != self._shape[1:]:
            raise ValueError(f"action of {agent} has shape {array.shape}, wanted {self._shape[1:]}")
        return array if self._discrete else to_float32(array)

    def _in_space(self, array: npt.NDArray[Any], agents: Sequence[str]) -> FloatArray:
        """Return rows of the right type and shape as kernel input, after a range check."""
        if self._discrete:
            outside = (array < 0) | (array >= len(MOTIONS))
            if outside.any():
                i = int(outside.argmax())
                raise ValueError(f"action of {agents[i]} is {array[i]}, outside 0 to {len(MOTIONS) - 1}")
            motions: FloatArray = MOTIONS[array][None]
            return motions
        kernel = to_float32(np.ascontiguousarray(array))[None]
        position = bad_action(kernel)
        if position >= 0:
            i, k = divmod(position, kernel.shape[2])
            part = _PARTS[k] if k < len(_PARTS) else f"message[{k - len(_PARTS)}]"
            raise ValueError(
                f"action of {agents[i]}: {part} = {kernel[0, i, k]} is not a number in [-1, 1]: "
                "scale or clip the policy's output first"
            )
        return np.clip(kernel, -1, 1) if position == TO_CLIP else kernel


def _as_array(action: npt.ArrayLike, subject: str) -> npt.NDArray[Any]:
    try:
        return np.asarray(action)
    except Exception:  # of numpy, or of a foreign object's own conversion
        raise ValueError(f"{subject} is not an array: {shown(action)}") from None
