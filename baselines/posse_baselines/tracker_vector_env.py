"""``posse/Tracker-v0`` as a vector environment: one learner's tracker in each of many worlds."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode

from posse import Scenario
from posse.adapters.vector_env import TeamVectorEnv
from posse.numeric import BoolArray, FloatArray
from posse_baselines.policy import Policy, begin
from posse_baselines.registry import load
from posse_baselines.tracker_env import fitting, with_teammates


class TrackerVectorEnv(TeamVectorEnv):
    """:class:`posse_baselines.tracker_env.TrackerEnv` in E worlds, stepped together.

    Args:
        scenario: Name of a scenario, or one; two trackers at least.
        num_envs: E, at least 1.
        number: Which tracker is driven, 0 to N - 1.
        teammates: What drives the others: a policy, or what :func:`posse_baselines.load` takes.
        silent: Whether the learner's action leaves out the message.
        settings: As for :class:`posse.adapters.vector_env.TeamVectorEnv`, without ``target_policy``.

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
        self.number = self._rows = number
        self._silent = silent
        self._fit = functools.partial(fitting, self.teammates, number)
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

    def _of_team(self, motions: FloatArray) -> FloatArray:
        self.batch.check_running()
        actions, self._memory = with_teammates(
            self.teammates, self.batch, self._team, self._memory, motions, self.number
        )
        return actions

    def _observed(self, observations: FloatArray) -> FloatArray:
        self._team = observations
        return super()._observed(observations)
