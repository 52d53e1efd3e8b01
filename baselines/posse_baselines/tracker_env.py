"""``posse/Tracker-v0``: the agent controls one tracker, its team-mates run a policy. One world, or many."""

from typing import Any

import gymnasium
import numpy as np

from posse import Batch, PairedBatch, Scenario, ScenarioError
from posse.adapters.gymnasium_env import TeamEnv, team_scenario
from posse.adapters.vector_env import TeamVectorEnv
from posse_baselines.policy import Policy
from posse_baselines.registry import load


class _WithTeammates:
    """The team-mates of one tracker in every world of a batch."""

    _rows: int | slice = 0

    def __init__(
        self, *arguments: Any, number: int = 0, teammates: str | Policy = "ddcs-distributed", **settings: Any
    ) -> None:
        self.teammates = load(teammates)
        self.number = number
        super().__init__(*arguments, **settings)

    def _fit(self, scenario: str | Scenario, **overrides: Any) -> Scenario:
        """Return the scenario with messages as long as the team-mates need."""
        found = team_scenario(scenario, **overrides)
        if found.num_trackers < 2:
            raise ScenarioError(f"num_trackers={found.num_trackers} leaves no team-mates: use posse/Solo-v0")
        number: object = self.number
        last = found.num_trackers - 1
        if not isinstance(number, (int, np.integer)) or isinstance(number, bool) or not 0 <= number <= last:
            raise ScenarioError(f"number={number!r} is not in the team: trackers are 0 to {last}")
        return found.replace(message_size=max(found.message_size, self.teammates.message_size))

    def _make(self, scenario: Scenario, num_worlds: int, target_policy: Any, **settings: Any) -> Batch:
        if target_policy is not None:
            raise TypeError("target_policy= is not possible in posse/Tracker-v0: a policy moves the team-mates already")
        return PairedBatch(scenario, num_worlds, self.teammates, outside=self.number, **settings)


class TrackerEnv(_WithTeammates, TeamEnv):
    """``posse/Tracker-v0``, after ``import posse_baselines``: one tracker whose team-mates run a policy.

    **Observation**: ``Box`` (F,) float32, the observation of this tracker, including the messages of its team-mates.
    **Action**: ``Box(-1, 1, (2,))``, or ``Discrete(15)``; it says zeros. **Reward**: of this tracker. **Info**,
    **start** and **end** as in ``posse/Team-v0``, with scalar reward terms. The score is that of the team: one tracker
    contributes at most 1/N. The scenario's ``message_size`` is raised to that of the team-mates' policy.

    Args:
        scenario: Name of a scenario, or a scenario, with at least two trackers.
        number: Number of the controlled tracker, 0 to N - 1.
        teammates: Policy of the others, or an argument of :func:`posse_baselines.load`.
        settings: As for :class:`posse.adapters.gymnasium_env.TeamEnv`, without ``target_policy``.

    Raises:
        ScenarioError: An unknown or invalid setting, a team of one, a target that is an agent, ``number`` not in the
            team.
        PolicyError: Unknown team-mates; TypeError if they are no policy.
    """


class TrackerVectorEnv(_WithTeammates, TeamVectorEnv):
    """:class:`TrackerEnv` in E worlds, stepped together; arguments as there and for :class:`TeamVectorEnv`."""


def register() -> None:
    """Register ``posse/Tracker-v0`` with Gymnasium; repeated calls have no effect."""
    if "posse/Tracker-v0" not in gymnasium.registry:
        gymnasium.register(
            "posse/Tracker-v0",
            entry_point="posse_baselines.tracker_env:TrackerEnv",
            vector_entry_point="posse_baselines.tracker_env:TrackerVectorEnv",
        )
