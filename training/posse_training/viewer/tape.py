"""One episode as far as it has been played: every moment is kept, so that time can run back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse import Batch, Scenario
from posse.numeric import FloatArray
from posse.rendering.content.history import History
from posse.rendering.content.scene import Scene, read_scene
from posse_baselines import Policy, begin
from posse_baselines.playing import check_moves_all

_MOST_BYTES: Final = 256 << 20
_LEAST_KEPT: Final = 600
_TRAIL_STEPS: Final = 6.5  # s of moments that a trail is drawn from


@dataclass(frozen=True)
class Moment:
    """The world at one control step, and what was decided in it. N trackers, F fields."""

    scene: Scene
    observations: FloatArray
    """(N, F)."""
    actions: FloatArray | None
    """(N, 2 + m), chosen in this moment; ``None``: the episode is over."""
    beliefs: dict[str, npt.NDArray[Any]]
    """Internal values of the policy, (N, ...) each."""
    reward: npt.NDArray[Any]
    """(N,) of the step that led here."""
    metrics: dict[str, float]
    """Every metric of the episode so far."""


class Tape:
    """Plays one policy in one world, and keeps every moment.

    At most 256 MiB are kept (the oldest moments are forgotten first), and at least 600 moments.

    Args:
        policy: Drives the trackers.
        scenario: Its messages are made as long as the policy needs.
        seed: Seed of the world.
        world: Index of the world.
        split: ``"train"``, ``"validation"`` or ``"test"``.

    Attributes:
        name: The policy's.
        scenario: With messages as long as needed.
        layout: Where each field lies in an observation.
        contacts: Steps in which a contact began.

    Raises:
        PolicyError: The policy does not fit the scenario, or the target is an agent.
    """

    def __init__(self, policy: Policy, scenario: Scenario, seed: int, world: int, split: str) -> None:
        check_moves_all(policy, scenario)
        longest = max(scenario.message_size, policy.message_size)
        self.scenario = scenario.replace(message_size=longest)
        self.name = policy.name
        self._policy = policy
        self._batch = Batch(self.scenario, 1, seed=seed, split=split, first_world=world, autoreset="disabled")
        self.layout = self._batch.layout
        self._memory = begin(policy, self._batch)
        self._observations = self._batch.reset()
        self._annotations: dict[str, npt.NDArray[Any]] = {}
        self._moments: list[Moment] = []
        self._first = 0
        self.contacts: list[int] = []
        each = self._batch.bytes_per_world + 4 * self._observations.size
        self._most = max(_LEAST_KEPT, _MOST_BYTES // each)
        self._actions = self._decide(np.zeros(self.scenario.num_agents))

    @property
    def over(self) -> bool:
        """Whether the episode has ended."""
        return bool(self._batch.worlds["over"][0])

    @property
    def first(self) -> int:
        """The oldest moment that is kept."""
        return self._first

    @property
    def last(self) -> int:
        """The latest moment."""
        return self._first + len(self._moments) - 1

    @property
    def end(self) -> int:
        """The step at which the episode ends, or has to end by."""
        return self.last if self.over else self.scenario.horizon

    def play(self, to: int, most: int) -> None:
        """Play up to a moment, but no more than ``most`` steps."""
        for _ in range(min(most, to - self.last)):
            if self.over or self._actions is None:
                return
            self._observations, rewards, *_ = self._batch.step(self._actions)
            self._actions = self._decide(rewards[0])
            if len(self._moments) > self._most:
                forgotten = len(self._moments) // 4
                del self._moments[:forgotten]
                self._first += forgotten

    def moment(self, step: int) -> Moment:
        """Return a moment; the nearest kept one, if that is not."""
        return self._moments[min(max(step, self._first), self.last) - self._first]

    def history(self, step: int) -> History:
        """Return the trails and contacts that belong to a moment."""
        back = round(_TRAIL_STEPS / self.scenario.control_step)
        history = History()
        for k in range(max(self._first, step - back), min(step, self.last) + 1):
            history.note(self.moment(k).scene)
        return history

    def _decide(self, reward: npt.NDArray[Any]) -> FloatArray | None:
        """Let the policy act on the present, and keep the moment."""
        actions = None
        if not self.over:
            actions, self._memory = self._policy.act(self._observations, self._memory)
            self._annotations = self._policy.annotations(self._memory)
        scene = read_scene(self._batch, 0, self._annotations, self._observations)
        if scene.struck.any():
            self.contacts.append(scene.step)
        metrics = {name: float(value[0]) for name, value in self._batch.metrics().items()}
        self._moments.append(
            Moment(
                scene,
                self._observations[0].copy(),
                None if actions is None else actions[0].copy(),
                {name: np.array(value)[0] for name, value in self._annotations.items()},
                np.array(reward),
                metrics,
            )
        )
        return actions
