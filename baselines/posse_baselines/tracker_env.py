"""``posse/Tracker-v0``: the agent controls one tracker, its team-mates run a policy."""

from __future__ import annotations

import functools
from typing import Any

import gymnasium
import numpy as np

from posse import Batch, Scenario, ScenarioError, get_scenario
from posse.adapters.gymnasium_env import TeamEnv
from posse.numeric import FloatArray, OwnArrays
from posse_baselines.policy import Policy, begin
from posse_baselines.registry import load


class TrackerEnv(OwnArrays, TeamEnv):
    """``posse/Tracker-v0``, after ``import posse_baselines``: one tracker whose team-mates run a policy.

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
        settings: As for :class:`posse.adapters.gymnasium_env.TeamEnv`, without ``target_policy``;
            ``discrete_actions`` requires ``silent``.

    Raises:
        ScenarioError: An unknown or invalid setting, a team of one, a target that is an agent.
        ValueError: ``number`` not in the team.
        PolicyError: Unknown team-mates.
    """

    def __init__(
        self,
        scenario: str | Scenario = "constant",
        *,
        number: int = 0,
        teammates: str | Policy = "ddcs-distributed",
        silent: bool = True,
        **settings: Any,
    ) -> None:
        self.teammates = load(teammates) if isinstance(teammates, str) else teammates
        self.number = self._rows = number
        self._silent = silent
        self._fit = functools.partial(fitting, self.teammates, number)
        self._memory: Any = None
        self._team: FloatArray = np.zeros(0, np.float32)
        super().__init__(scenario, **settings)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Start an episode; see :class:`posse.adapters.gymnasium_env.TeamEnv`."""
        result = super().reset(seed=seed, options=options)
        self._team = self.batch.observe()
        self._memory = begin(self.teammates, self.batch)
        return result

    def _advance(self, actions: FloatArray) -> Any:
        results = super()._advance(actions)
        self._team = results.observations[None].copy()  # policies may keep observations
        return results

    def _of_team(self, motions: FloatArray) -> FloatArray:
        actions, self._memory = with_teammates(
            self.teammates, self.batch, self._team, self._memory, motions[None], self.number
        )
        return actions


def with_teammates(
    teammates: Policy, batch: Batch, team: FloatArray, memory: Any, own: FloatArray, number: int
) -> tuple[FloatArray, Any]:
    """Return the actions of the teams (E, N, 2 + m), given those of a tracker (E, 2 or 2 + m), and the memory.

    Own actions are checked before the team-mates act.
    """
    actions = np.zeros(batch.action_shape, np.float32)
    actions[:, number, : own.shape[1]] = own
    mine = batch.check_actions(actions)[:, number]
    others, memory = teammates.act(team, memory)
    actions = batch.check_actions(others).copy()
    actions[:, number] = mine
    return actions, memory


def fitting(teammates: Policy, number: int, scenario: str | Scenario, overrides: dict[str, Any]) -> Scenario:
    """Return the scenario with messages as long as the team-mates need.

    Raises:
        ScenarioError: Its target is an agent, or the team has one tracker.
        ValueError: ``number`` is not in the team.
    """
    found = get_scenario(scenario, **overrides)
    if found.target_motion == "agent":
        raise ScenarioError(
            "target_motion='agent' is not possible in posse/Tracker-v0, whose agent is a tracker: "
            "use posse.parallel_env(..., target='agent')"
        )
    if found.num_trackers < 2:
        raise ScenarioError(f"num_trackers={found.num_trackers} leaves no team-mates: use posse/Solo-v0")
    if number not in range(found.num_trackers):
        raise ValueError(f"number={number!r} is not in the team: trackers are 0 to {found.num_trackers - 1}")
    return found.replace(message_size=max(found.message_size, teammates.message_size))


def register() -> None:
    """Register ``posse/Tracker-v0`` with Gymnasium; repeated calls have no effect."""
    if "posse/Tracker-v0" not in gymnasium.registry:
        gymnasium.register(
            "posse/Tracker-v0",
            entry_point="posse_baselines.tracker_env:TrackerEnv",
            vector_entry_point="posse_baselines.tracker_vector_env:TrackerVectorEnv",
        )
