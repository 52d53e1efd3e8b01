"""Records an episode of a batch for a replay."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from posse import Batch
from posse.numeric import BoolArray, FloatArray
from posse_training.errors import SettingsError
from posse_training.replay.columns import (
    STATES,
    action_columns,
    belief_columns,
    last_kept,
    observation_columns,
    reward_columns,
    state_columns,
)
from posse_training.replay.episode import Player, Replay
from posse_training.replay.events import find_events
from posse_training.replay.world import describe_world


class Recorder:
    """A batch that records one of its worlds for a replay.

    It is used instead of the batch, one episode at a time::

        recorder = Recorder(batch, "mine")
        observations = recorder.reset()
        while not recorder.over:
            actions = ...
            observations, rewards, terminated, truncated, infos = recorder.step(actions)
        write_replay(recorder.replay(), "mine.html")

    Args:
        batch: The worlds.
        name: Name of the player on the page.
        world: Index of the recorded world in the batch.
        observations: Whether to record all observations.
        about: Description of the policy; plain JSON.

    Raises:
        SettingsError: No such world in the batch, or autoreset "same_step", which overwrites the
            last state of an episode.
    """

    def __init__(
        self,
        batch: Batch,
        name: str,
        *,
        world: int = 0,
        observations: bool = True,
        about: Mapping[str, Any] | None = None,
    ) -> None:
        if not 0 <= world < batch.num_worlds:
            raise SettingsError(f"world={world} is not in the batch: it holds worlds 0 to {batch.num_worlds - 1}")
        if batch.autoreset == "same_step":
            raise SettingsError(
                "a batch with autoreset='same_step' loses its last states and cannot be recorded: "
                "make it with autoreset='disabled'"
            )
        self.batch = batch
        self.name = name
        self._world = world
        self._whole = observations
        self._about = dict(about or {})
        self._clear()

    def _clear(self) -> None:
        self._states: dict[str, list[npt.NDArray[Any]]] = {name: [] for name in STATES}
        self._observations: list[FloatArray] = []
        self._actions: list[FloatArray] = []
        self._terms: dict[str, list[npt.NDArray[Any]]] = {}
        self._beliefs: dict[str, list[npt.NDArray[Any]]] = {}
        self._described: dict[str, Any] = {}
        self._metrics: dict[str, float] = {}

    @property
    def over(self) -> bool:
        """Whether the recorded episode has ended."""
        return bool(self.batch.terminated[self._world] or self.batch.truncated[self._world])

    def reset(self, **arguments: Any) -> FloatArray:
        """Start an episode (see :meth:`posse.Batch.reset`) and record from here."""
        observations = self.batch.reset(**arguments)
        self._clear()
        self._described = describe_world(self.batch, self._world, self._whole)
        self._note(observations)
        return observations

    def step(
        self, actions: npt.ArrayLike, beliefs: Mapping[str, npt.ArrayLike] | None = None
    ) -> tuple[FloatArray, FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """Advance the batch (see :meth:`posse.Batch.step`) and record the step.

        Args:
            actions: (E, rows, 2 + message_size) in [-1, 1].
            beliefs: Annotations by the policy, (E, N, ...) each: ``policy.annotations(memory)``.

        Raises:
            SettingsError: Before :meth:`reset`, or after the end of the recorded episode.
        """
        if not self._observations:
            raise SettingsError("nothing is recorded before reset: call the recorder's reset()")
        if self.over:
            raise SettingsError("the recorded episode has ended: call the recorder's reset()")
        told = {name: np.array(value)[self._world] for name, value in (beliefs or {}).items()}
        done = self.batch.step(actions)
        observations, *_, infos = done
        self._actions.append(np.array(actions, np.float32)[self._world])
        for name in self._described["weights"]:
            self._terms.setdefault(name, []).append(infos[f"reward/{name}"][self._world])
        for name, value in told.items():
            self._beliefs.setdefault(name, []).append(value)
        self._note(observations)
        return done

    def _note(self, observations: FloatArray) -> None:
        state = self.batch.state
        for name, column in self._states.items():
            column.append(state[name][self._world].copy())
        self._observations.append(observations[self._world].copy())
        self._metrics = {name: float(value[self._world]) for name, value in self.batch.metrics().items()}

    def player(self) -> Player:
        """Return the episode recorded so far.

        Raises:
            SettingsError: Nothing has been recorded.
        """
        if not self._observations:
            raise SettingsError("nothing is recorded before reset: call the recorder's reset()")
        states = {name: np.stack(column) for name, column in self._states.items()}
        beliefs = {name: last_kept(column) for name, column in self._beliefs.items()}
        scenario = self.batch.scenario
        columns = {
            **state_columns(states, scenario),
            **action_columns(self._actions, self._whole),
            **reward_columns(self._terms),
            **belief_columns(beliefs, self._whole),
            **observation_columns(self.batch.layout, np.stack(self._observations), self._whole),
        }
        events = find_events(states, scenario.control_step, beliefs.get("leader"))
        return Player(self.name, columns, events, dict(self._metrics), self._about)

    def replay(self) -> Replay:
        """Return the episode recorded so far as a replay with one player."""
        player = self.player()
        return Replay(self._described, (player,))
