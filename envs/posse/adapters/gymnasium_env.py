"""Gymnasium environments: one agent controls the team, or a single tracker."""

from typing import Any

import gymnasium

from posse.adapters.actions import as_motions
from posse.adapters.base import WorldEnv
from posse.engine.arguments import in_box
from posse.numeric import FloatArray
from posse.scenarios import Scenario, ScenarioError, get_scenario


def team_scenario(scenario: str | Scenario, **overrides: Any) -> Scenario:
    """Return the scenario of an environment of one agent; ScenarioError if its target is an agent."""
    found = get_scenario(scenario, **overrides)
    if found.target_motion == "agent":
        raise ScenarioError(
            "target_motion='agent' is not possible in an environment of one agent: use posse.parallel_env(..., "
            "target_motion='agent'), a scripted target_motion, or target_policy="
        )
    return found


def solo_scenario(scenario: str | Scenario, **overrides: Any) -> Scenario:
    """Return the scenario with one tracker; ScenarioError if it is to have more, or one that breaks."""
    if overrides.setdefault("num_trackers", 1) != 1:
        raise ScenarioError(
            f"num_trackers={overrides['num_trackers']!r} does not fit posse/Solo-v0, which has one: use posse/Team-v0"
        )
    whole = get_scenario(scenario)
    if whole.breaks > 0 and "breaks" not in overrides:
        raise ScenarioError(
            f"{whole.name!r}, in which breaks={whole.breaks} of the trackers break, does not fit posse/Solo-v0: "
            "pass breaks=0, or use posse/Team-v0"
        )
    return team_scenario(scenario, **overrides)


class TeamEnv(WorldEnv, gymnasium.Env[Any, Any]):
    """``posse/Team-v0``: one agent controls the whole team.

    State, start and end are those of :class:`posse.adapters.pettingzoo_env.TeamParallelEnv`.

    **Observation**: ``Box`` (N, F) float32, the observation of each tracker; its fields are
    ``posse.observation_fields(scenario)``, and ``env.unwrapped.layout.views(observation)`` names them.

    **Action**: ``Box(-1, 1, (N, 2 + message_size))`` float32, the action of each tracker there. With
    ``discrete_actions=True`` ``MultiDiscrete([15] * N)``.

    **Reward**: the mean over the trackers of the weighted sum of named terms.

    **Info**: as there, with ``"reward/<term>"`` and ``"working"`` (N,).

    Args:
        scenario: Name of a scenario, or a scenario.
        settings: Further arguments of :class:`posse.adapters.base.BatchEnv`, or any field of
            :class:`posse.Scenario`.
    """

    _fit = staticmethod(team_scenario)

    def __init__(self, scenario: str | Scenario = "constant", **settings: Any) -> None:
        super().__init__(scenario, **settings)
        self.observation_space, self.action_space = self._spaces()
        self._shape = self.action_space.shape  # to ask the space takes a percent of a step

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[FloatArray, dict[str, Any]]:
        """Start an episode; a bad seed or option is a ValueError that changes nothing."""
        observation = self._start(seed, options)
        gymnasium.Env.reset(self, seed=None if seed is None else int(seed))
        return observation, self._info()

    def step(self, action: Any) -> tuple[FloatArray, float, bool, bool, dict[str, Any]]:
        """Advance the world by one control step; errors are those of :meth:`posse.Batch.step`."""
        batch, own = self.batch, self._own
        batch.check_running()
        self._advance(self.actions_of(action))
        rewards = own.rewards.tolist()
        ends = (own.terminated.item(), own.truncated.item()) if batch._over else (False, False)
        return own.observations.copy(), sum(rewards) / len(rewards), *ends, self._info()

    def actions_of(self, action: Any) -> FloatArray:
        """Return an action as an array (1, rows, 2 + m) in [-1, 1]; ValueError as for :meth:`step`."""
        motions = as_motions("action", action, self._shape, self._discrete)
        return in_box(motions.reshape(self.batch.action_shape), self.batch.clip_actions)

    def _info(self) -> dict[str, Any]:
        info, terms = self._common_info(), self._own.terms
        values = terms.copy() if terms.ndim == 2 else terms.tolist()
        for key, k in self.batch._rewards:
            info[key] = values[k]
        if self.scenario.breaks:
            working = self.batch.working[0, self._rows]
            info["working"] = working if working.ndim else bool(working)
        return info


class SoloEnv(TeamEnv):
    """``posse/Solo-v0``: one tracker, one target.

    As :class:`TeamEnv` with a team of one, without the team axis: **observation** ``Box`` (F,),
    **action** ``Box(-1, 1, (2 + message_size,))`` or ``Discrete(15)``, reward terms scalars.
    ``options["tracker_pose"]`` may be (3,).
    """

    _rows = 0
    _fit = staticmethod(solo_scenario)
