"""``posse/Tracker-v0``: a learner drives one tracker, its team-mates run any policy."""

from __future__ import annotations

from typing import Any, ClassVar

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from posse import ObservationLayout, Scenario, ScenarioError
from posse.adapters.actions import ActionReader, single_action_space
from posse.adapters.single_world import RENDER_MODES, SingleWorld, frames_per_second, shortened
from posse.adapters.spaces import box
from posse.numeric import FloatArray, OwnArrays
from posse_baselines.policy import Policy, begin
from posse_baselines.registry import load


class TrackerEnv(OwnArrays, gymnasium.Env[Any, Any]):
    """One tracker among scripted (or learned) team-mates.

    **Observation**: ``Box`` (F,) float32, what this tracker is given, the messages of its
    team-mates included. **Action**: ``Box(-1, 1, (2 + message_size,))``, or ``Discrete(15)``.
    **Reward**: this tracker's own. **Info**, **start** and **end** as in ``posse/Team-v0``; reward
    terms are plain numbers. The score is the whole team's: one tracker raises it by at most 1/N.

    The scenario's ``message_size`` is as large as the team-mates need. A learner that has nothing
    to say sends zeros: with ``silent=True`` (the default) its action has two parts, and its message
    is always zeros.

    Args:
        scenario: Name of a scenario, or one; two trackers at least.
        number: Which tracker is driven, 0 to N - 1.
        teammates: What drives the others: a policy, or what :func:`posse_baselines.load` takes.
        silent: Whether the learner's action leaves out the message.
        discrete_actions: Whether actions are discrete; needs ``silent``.
        render_mode: ``"human"``, ``"rgb_array"`` or ``None``.
        seed: Of every random draw; ``None``: an arbitrary one.
        split: ``"train"``, ``"validation"`` or ``"test"``.
        first_world: Which world of the seed.
        max_episode_steps: Cuts episodes to this many steps; ``None``: the scenario's horizon.
        overrides: Any field of :class:`posse.Scenario`.

    Raises:
        ScenarioError: An unknown or impossible setting, a team of one, a target that is an agent.
        ValueError: ``number`` not in the team, an unknown split or render mode.
        PolicyError: Unknown team-mates.
    """

    metadata: ClassVar[dict[str, Any]] = {  # type: ignore[misc]
        "render_modes": list(RENDER_MODES),
        "render_fps": 10,
    }

    def __init__(
        self,
        scenario: str | Scenario = "constant",
        *,
        number: int = 0,
        teammates: str | Policy = "ddcs-distributed",
        silent: bool = True,
        discrete_actions: bool = False,
        render_mode: str | None = None,
        seed: int | None = None,
        split: str = "train",
        first_world: int = 0,
        max_episode_steps: int | None = None,
        **overrides: Any,
    ) -> None:
        self.teammates = load(teammates) if isinstance(teammates, str) else teammates
        settings = shortened(scenario, max_episode_steps, overrides)
        self.scenario = settings.replace(
            message_size=max(settings.message_size, self.teammates.message_size)
        )
        _check(self.scenario, number)
        self.number = number
        self._world = SingleWorld(
            self.scenario, seed=seed, split=split, first_world=first_world, render_mode=render_mode
        )
        self.metadata = {  # type: ignore[misc]
            **type(self).metadata,
            "render_fps": frames_per_second(self.scenario),
        }
        self.render_mode = render_mode
        self.layout: ObservationLayout = self._world.batch.layout
        self.observation_space: spaces.Box = box(self.layout.bounds())
        # What the learner's action is read by: a scenario without messages, where it is silent.
        spoken = self.scenario.replace(message_size=0) if silent else self.scenario
        self.action_space = single_action_space(spoken, discrete_actions)
        self._reader = ActionReader(spoken, discrete_actions)
        self._memory: Any = None
        self._observations: FloatArray = np.zeros(0, np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Start an episode.

        Raises:
            ValueError: A bad seed or option; nothing is changed.
        """
        self._observations = self._world.reset(seed, options)[None]
        super().reset(seed=None if seed is None else int(seed))
        self._memory = begin(self.teammates, self._world.batch)
        if self.render_mode == "human":
            self.render()
        return self._own(self._observations), {}

    def step(self, action: Any) -> tuple[FloatArray, float, bool, bool, dict[str, Any]]:
        """Advance the world by one control step.

        Raises:
            ResetNeeded: Before the first reset, or after the end.
            ValueError: An action of a wrong type or shape, not finite, or out of its space;
                nothing is changed.
        """
        world = self._world
        world.check_running()
        own = self._reader.one(f"tracker_{self.number}", action)
        actions, self._memory = self.teammates.act(self._observations, self._memory)
        team = world.actions.read
        team[...] = world.batch.check_actions(actions)
        team[0, self.number] = 0
        team[0, self.number, : len(own)] = own
        over = world.advance()
        self._observations = world.observations[None].copy()  # team-mates may keep what they saw
        info: dict[str, Any] = {
            "score": world.score,
            "reward_terms": world.name_terms(*world.terms[self.number].tolist()),
            "working": bool(world.working()[self.number]),
        }
        terminated = truncated = False
        if over:
            terminated, info["metrics"] = world.end()
            truncated = not terminated
        if self.render_mode == "human":
            self.render()
        reward = float(world.rewards[self.number])
        return self._own(self._observations), reward, terminated, truncated, info

    def render(self) -> npt.NDArray[np.uint8] | None:
        """Draw the world as it stands: (H, W, 3) uint8 in the mode "rgb_array".

        Raises:
            ResetNeeded: Before the first reset.
        """
        return self._world.render()

    def close(self) -> None:
        """Close the window, if there is one."""
        self._world.close()

    def _own(self, observations: FloatArray) -> FloatArray:
        own: FloatArray = observations[0, self.number].copy()
        return own


def _check(scenario: Scenario, number: int) -> None:
    if scenario.target_motion == "agent":
        raise ScenarioError(
            "target_motion='agent' has no place in posse/Tracker-v0, whose learner is a tracker: "
            "use posse.parallel_env(..., target='agent')"
        )
    if scenario.num_trackers < 2:
        raise ScenarioError(
            f"num_trackers={scenario.num_trackers} leaves no team-mates: use posse/Solo-v0"
        )
    if number not in range(scenario.num_trackers):
        raise ValueError(
            f"number={number!r} is not in the team: trackers are 0 to {scenario.num_trackers - 1}"
        )


def register() -> None:
    """Make ``posse/Tracker-v0`` known to Gymnasium, once however often it is called."""
    if "posse/Tracker-v0" not in gymnasium.registry:
        gymnasium.register("posse/Tracker-v0", entry_point="posse_baselines.tracker_env:TrackerEnv")
