"""``posse/Tracker-v0`` as a vector environment: one learner's tracker in each of many worlds."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces
from gymnasium.vector import AutoresetMode

from posse import Scenario
from posse.adapters import real_numbers
from posse.adapters.actions import single_action_space
from posse.adapters.single_world import shortened
from posse.adapters.spaces import box
from posse.adapters.vector_env import TeamVectorEnv
from posse.numeric import BoolArray, FloatArray
from posse.signals.observation.layout import ObservationLayout
from posse_baselines.policy import Policy, begin
from posse_baselines.registry import load
from posse_baselines.tracker_env import fitting


class TrackerVectorEnv(TeamVectorEnv):
    """:class:`posse_baselines.tracker_env.TrackerEnv` in E worlds, stepped together.

    Arguments, infos and autoreset modes as for :class:`posse.adapters.vector_env.TeamVectorEnv`.

    Args:
        scenario: Name of a scenario, or one; two trackers at least.
        num_envs: E, at least 1.
        number: Which tracker is driven, 0 to N - 1.
        teammates: What drives the others: a policy, or what :func:`posse_baselines.load` takes.
        silent: Whether the learner's action leaves out the message.
        settings: As for :class:`posse.adapters.vector_env.TeamVectorEnv`.

    Raises:
        ScenarioError, ValueError, PolicyError: As for the single environment.
    """

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
        self.teammates = load(teammates) if isinstance(teammates, str) else teammates
        self.number = number
        self._silent = silent
        self._memory: Any = None
        self._team: FloatArray = np.zeros(0, np.float32)
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
        if self.autoreset_mode == AutoresetMode.NEXT_STEP:
            begins = self.batch.worlds["step"] == 0
        elif self.autoreset_mode == AutoresetMode.SAME_STEP:
            begins = result[2] | result[3]
        else:
            return result
        if begins.any():
            self._memory = self.teammates.restart(self._memory, begins)
        return result

    def _motions(self, actions: Any) -> npt.NDArray[Any]:
        own = real_numbers("actions", super()._motions(actions))
        team = np.zeros(self.batch.action_shape, np.float32)
        team[:, self.number, : own.shape[1]] = own
        team = self.batch.check_actions(team).copy()
        ended = self.batch.terminated | self.batch.truncated
        if self._memory is None or (self.autoreset_mode == AutoresetMode.DISABLED and ended.any()):
            return team  # the batch refuses the step: nothing may change
        others, self._memory = self.teammates.act(self._team, self._memory)
        mine = team[:, self.number].copy()
        team[...] = self.batch.check_actions(others)
        team[:, self.number] = mine
        return team

    def _shape_of_motions(self) -> tuple[int, ...]:
        return self.num_envs, 2 if self._silent else self.batch.action_shape[2]

    def _fitting(self, scenario: str | Scenario, horizon: int | None, overrides: dict[str, Any]) -> Scenario:
        return fitting(shortened(scenario, horizon, overrides), self.teammates, self.number)

    def _spaces(self, discrete_actions: bool) -> tuple[spaces.Box, spaces.Space[Any]]:
        spoken = self.scenario.replace(message_size=0) if self._silent else self.scenario
        bounds = ObservationLayout(self.scenario).bounds()
        return box(bounds), single_action_space(spoken, discrete_actions)

    def _keep(self, observations: FloatArray) -> None:
        self._team = observations

    @property
    def tells_working(self) -> bool:
        """Whether infos say if the tracker works: always, as the single environment."""
        return True

    def _working(self, working: BoolArray) -> BoolArray:
        return working[:, self.number]

    def _observed(self, observations: FloatArray) -> FloatArray:
        return observations[:, self.number].copy()

    def _rewarded(self, rewards: FloatArray) -> npt.NDArray[np.float64]:
        return rewards[:, self.number].astype(np.float64)

    def _of_agents(self, values: FloatArray) -> npt.NDArray[Any]:
        return values[:, self.number].astype(np.float64)
