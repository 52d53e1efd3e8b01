"""One round: a world in which a person drives one robot, and a policy the others."""

from __future__ import annotations

from typing import Any

import numpy as np

from posse import Batch, Scenario
from posse.rendering.content.history import History
from posse.rendering.content.scene import Scene, read_scene
from posse_baselines import Policy, Recorder, begin
from posse_training.play.session import points_of
from posse_training.play.steering import Wheel
from posse_training.replay import RECORD, Replay, replay_of


class Round:
    """A world at play; every step is recorded.

    Args:
        policy: Drives the trackers, all but the player's.
        scenario: Of the world; where the player is the target, its target is an agent.
        robot: Number of the player's tracker; N: the target.
        seed: Seed of the world.
        world: Index of the world.
        split: Split of the world.

    Attributes:
        scene: The present.
        history: Trails and contacts.
    """

    def __init__(self, policy: Policy, scenario: Scenario, robot: int, seed: int, world: int, split: str) -> None:
        self._policy, self._robot, self._n = policy, robot, scenario.num_trackers
        batch = Batch(scenario, 1, seed=seed, split=split, first_world=world, autoreset="disabled")
        who = "you as the target" if robot == self._n else f"you as tracker {robot}"
        self._label = f"{policy.name}, {who}"
        self._recorder = Recorder(batch, RECORD)
        self._memory = begin(policy, batch)
        self._observations = self._recorder.reset()
        self._annotations: dict[str, Any] = {}
        self.history = History()
        self._look()

    @property
    def over(self) -> bool:
        """Whether the round has ended."""
        return bool(self._recorder.over[0])

    @property
    def points(self) -> float:
        """The player's points so far, 0 to 100."""
        return points_of(self.scene.score, self._robot == self._n)

    @property
    def left(self) -> float:
        """Simulated time left, s."""
        return self.scene.scenario.duration - self.scene.time

    def step(self, wheel: Wheel) -> None:
        """Advance by one control step, the player's robot as the wheel asks."""
        batch = self._recorder.batch
        actions = np.zeros(batch.action_shape, np.float32)
        trackers = np.ascontiguousarray(self._observations[:, : self._n])
        actions[:, : self._n], self._memory = self._policy.act(trackers, self._memory)
        self._annotations = self._policy.annotations(self._memory)
        actions[0, self._robot, :2] = wheel.speed, wheel.turn
        self._observations, *_ = self._recorder.step(actions, self._annotations)
        self._look()

    def replay(self) -> Replay:
        """Return what has been played so far."""
        return replay_of(self._recorder.trajectory(), self._label)

    def _look(self) -> None:
        self.scene: Scene = read_scene(self._recorder.batch, 0, self._annotations, self._observations)
        self.history.note(self.scene)
