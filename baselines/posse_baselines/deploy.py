"""A policy on one real robot."""

from typing import Any

import numpy as np

from posse import Command, Robot
from posse_baselines.policy import Policy, PolicyError, check_policy


class deploy:  # noqa: N801 (used as a function is)
    """A policy that drives one robot, memory inside; the robot's ``message_size`` has to be at least the policy's.

    Attributes:
        row: (F,) the robot's last observation.

    Raises:
        PolicyError: The policy reads the state of the worlds or the observations of all trackers together
            (``whole_team``), or does not fit the robot's scenario; TypeError if it is no policy.
    """

    def __init__(self, policy: Policy, robot: Robot) -> None:
        check_policy(policy)
        if policy.reads_state:
            raise PolicyError(f"policy {policy.name!r} reads the state of the worlds, which no robot measures")
        if getattr(policy, "whole_team", False):
            raise PolicyError(f"policy {policy.name!r} reads the observations of all trackers, and a robot has its own")
        self.policy, self.robot = policy, robot
        self.reset()
        self.step((0.0, 0.0, 0.0), 0.0, 0.0)  # compiles, which would halt a control loop
        self.reset()

    def reset(self) -> None:
        """Begin an episode: robot and policy forget everything."""
        self.robot.reset()
        self._memory = self.policy.begin(self.robot.layout, 1)

    def step(self, *measurements: Any, **more: Any) -> Command:
        """Return the command for the measurements of a control step, which :meth:`posse.Robot.observe` describes."""
        row = self.row = self.robot.observe(*measurements, **more)
        # A policy's rows are independent of each other: this robot's is the only one whose action is read.
        team = np.tile(row, (1, self.robot.scenario.num_trackers, 1))
        actions, self._memory = self.policy.act(team, self._memory)
        return self.robot.command(actions[0, self.robot.number])
