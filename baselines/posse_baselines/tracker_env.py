"""``posse/Tracker-v0``: the agent controls one tracker, its team-mates run a policy."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from posse import Scenario, ScenarioError
from posse.adapters.actions import ActionReader, single_action_space
from posse.adapters.single_world import shortened
from posse.adapters.spaces import box
from posse.adapters.world_env import OneAgentEnv
from posse.numeric import FloatArray, OwnArrays
from posse_baselines.policy import Policy, begin
from posse_baselines.registry import load


class TrackerEnv(OwnArrays, OneAgentEnv):
    """One tracker whose team-mates run a scripted or learned policy.

    **Observation**: ``Box`` (F,) float32, the observation of this tracker, including the messages
    of its team-mates. **Action**: ``Box(-1, 1, (2 + message_size,))``, or ``Discrete(15)``.
    **Reward**: of this tracker. **Info**, **start** and **end** as in ``posse/Team-v0``, with
    scalar reward terms. The score is that of the team: one tracker contributes at most 1/N.

    The scenario's ``message_size`` is raised to that of the team-mates' policy. With
    ``silent=True`` (the default) the action has no message part, and the message is zeros.

    Args:
        scenario: Name of a scenario, or a scenario, with at least two trackers.
        number: Number of the controlled tracker, 0 to N - 1.
        teammates: Policy of the others, or an argument of :func:`posse_baselines.load`.
        silent: Whether the action has no message part.
        discrete_actions: Whether actions are discrete; requires ``silent``.
        render_mode: ``"human"``, ``"rgb_array"`` or ``None``.
        seed: Seed of all random draws; ``None``: an arbitrary one.
        split: ``"train"``, ``"validation"`` or ``"test"``.
        first_world: Index of the world within the seed.
        max_episode_steps: Steps per episode; ``None``: the scenario's horizon.
        flat_infos: Whether infos are without nested dictionaries: ``info["metrics/score"]`` for
            ``info["metrics"]["score"]``.
        overrides: Any field of :class:`posse.Scenario`.

    Raises:
        ScenarioError: An unknown or invalid setting, a team of one, a target that is an agent.
        ValueError: ``number`` not in the team, an unknown split or render mode.
        PolicyError: Unknown team-mates.
    """

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
        flat_infos: bool = False,
        **overrides: Any,
    ) -> None:
        self.teammates = load(teammates) if isinstance(teammates, str) else teammates
        settings = shortened(scenario, max_episode_steps, overrides)
        settings = fitting(settings, self.teammates, number)
        self.number = number
        self._flat_infos = flat_infos
        self._open(settings, render_mode=render_mode, seed=seed, split=split, first_world=first_world)
        self.observation_space: spaces.Box = box(self.layout.bounds())
        # Scenario by which the action is read: without messages if it has no message part.
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
        self._observations = self._begin(seed, options)[None]
        self._memory = begin(self.teammates, self._world.batch)
        info = {
            "score": 0.0,
            "reward_terms": self._world.no_terms,
            "metrics": self._world.no_metrics.copy(),
            "working": bool(self._world.working()[self.number]),
        }
        return self._own(self._observations), self._told(info)

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
        self._observations = world.observations[None].copy()  # policies may keep observations
        info: dict[str, Any] = {
            "score": world.score(),
            "reward_terms": world.name_terms(*world.terms[self.number].tolist()),
            "metrics": world.no_metrics.copy(),
            "working": bool(world.working()[self.number]),
        }
        terminated, truncated, info = self._end(over, info)
        reward = float(world.rewards[self.number])
        return self._own(self._observations), reward, terminated, truncated, info

    def _own(self, observations: FloatArray) -> FloatArray:
        own: FloatArray = observations[0, self.number].copy()
        return own


def fitting(scenario: Scenario, teammates: Policy, number: int) -> Scenario:
    """Return the scenario with messages as long as the team-mates need.

    Raises:
        ScenarioError: Its target is an agent, or the team has one tracker.
        ValueError: ``number`` is not in the team.
    """
    if scenario.target_motion == "agent":
        raise ScenarioError(
            "target_motion='agent' is not possible in posse/Tracker-v0, whose agent is a tracker: "
            "use posse.parallel_env(..., target='agent')"
        )
    if scenario.num_trackers < 2:
        raise ScenarioError(f"num_trackers={scenario.num_trackers} leaves no team-mates: use posse/Solo-v0")
    if number not in range(scenario.num_trackers):
        raise ValueError(f"number={number!r} is not in the team: trackers are 0 to {scenario.num_trackers - 1}")
    return scenario.replace(message_size=max(scenario.message_size, teammates.message_size))


def register() -> None:
    """Register ``posse/Tracker-v0`` with Gymnasium; repeated calls have no effect."""
    if "posse/Tracker-v0" not in gymnasium.registry:
        gymnasium.register(
            "posse/Tracker-v0",
            entry_point="posse_baselines.tracker_env:TrackerEnv",
            vector_entry_point="posse_baselines.tracker_vector_env:TrackerVectorEnv",
        )
