"""``posse/Tracker-v0``: the agent controls one tracker, its team-mates run a policy. One world, or many."""

from __future__ import annotations

import functools
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode

from posse import Batch, Scenario, ScenarioError, get_scenario
from posse.adapters.gymnasium_env import TeamEnv
from posse.adapters.vector_env import TeamVectorEnv
from posse.numeric import BoolArray, FloatArray
from posse_baselines.policy import Policy, begin
from posse_baselines.registry import load


class _WithTeammates:
    """The team-mates of one tracker in every world of a batch."""

    batch: Batch
    _rows: Any
    _fit: Any

    def _join(self, number: int, teammates: str | Policy, silent: bool) -> None:
        self.teammates = load(teammates) if isinstance(teammates, str) else teammates
        self.number = self._rows = number
        self._silent = silent
        self._fit = functools.partial(_fitting, self.teammates, number)
        self._memory: Any = None
        # (E, N, F) what the team observes; never written to, since policies may keep observations.
        self._team: FloatArray = np.zeros(0, np.float32)

    def _of_team(self, own: FloatArray) -> FloatArray:
        """Return the teams' actions (E, N, 2 + m), given those of one tracker (E, 2 or 2 + m)."""
        self.batch.check_running()
        team = np.zeros(self.batch.action_shape, np.float32)
        team[:, self.number, : own.shape[1]] = own
        own = self.batch.check_actions(team)[:, self.number]  # refused before the team-mates' memory changes
        actions, memory = self.teammates.act(self._team, self._memory)
        team = self.batch.check_actions(actions).copy()
        team[:, self.number] = own
        self._memory = memory
        return team


class TrackerEnv(_WithTeammates, TeamEnv):
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
        self._join(number, teammates, silent)
        super().__init__(scenario, **settings)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Start an episode; see :class:`posse.adapters.gymnasium_env.TeamEnv`."""
        result = super().reset(seed=seed, options=options)
        self._team = self.batch.observe()
        self._memory = begin(self.teammates, self.batch)
        return result

    def _advance(self, actions: FloatArray) -> None:
        super()._advance(self._of_team(actions[:, 0]))
        self._team = self._results.observations.copy()


class TrackerVectorEnv(_WithTeammates, TeamVectorEnv):
    """:class:`TrackerEnv` in E worlds, stepped together; arguments as there and for :class:`TeamVectorEnv`."""

    def __init__(
        self,
        scenario: str | Scenario = "constant",
        num_envs: int = 1,
        *,
        number: int = 0,
        teammates: str | Policy = "ddcs-distributed",
        silent: bool = True,
        **settings: Any,
    ) -> None:
        self._join(number, teammates, silent)
        super().__init__(scenario, num_envs, **settings)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Start episodes; see :meth:`TeamVectorEnv.reset`."""
        result = super().reset(seed=seed, options=options)
        mask = (options or {}).get("reset_mask")
        if mask is None or self._memory is None:
            self._memory = begin(self.teammates, self.batch)
        else:
            self._memory = self.teammates.restart(self._memory, np.array(mask, np.bool_))
        return result

    def step(self, actions: Any) -> tuple[FloatArray, npt.NDArray[np.float64], BoolArray, BoolArray, dict[str, Any]]:
        """Advance every world by one control step; see :meth:`TeamVectorEnv.step`."""
        result = super().step(actions)
        if self.autoreset_mode == AutoresetMode.SAME_STEP:
            begins = result[2] | result[3]
        else:
            begins = self.batch.worlds["step"] == 0
        if begins.any():
            self._memory = self.teammates.restart(self._memory, begins)
        return result

    def _observed(self, observations: FloatArray) -> FloatArray:
        self._team = observations
        return super()._observed(observations)


def _fitting(teammates: Policy, number: int, scenario: str | Scenario, **overrides: Any) -> Scenario:
    """Return the scenario with messages as long as the team-mates need."""
    found = get_scenario(scenario, **overrides)
    if found.target_motion == "agent":
        raise ScenarioError(
            "target_motion='agent' is not possible in posse/Tracker-v0, whose agent is a tracker: "
            "use posse.parallel_env(..., target_motion='agent')"
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
            vector_entry_point="posse_baselines.tracker_env:TrackerVectorEnv",
        )
