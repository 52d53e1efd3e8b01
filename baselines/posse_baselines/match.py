"""A policy of the trackers and one of the target, as one policy that moves all robots."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from posse import Batch, ObservationLayout
from posse.numeric import BoolArray, FloatArray
from posse_baselines.policy import Annotations, BasePolicy, Memory, Policy, PolicyError, StateReader
from posse_baselines.targets import Target


class Match(BasePolicy):
    """Moves the trackers by one policy and the target by another.

    It plays worlds whose target is an agent: observations (E, N + 1, F), actions (E, N + 1, 2 + m),
    the target's row last. All else is as in the policy of the trackers.

    Args:
        policy: Moves the trackers.
        target: Moves the target; one with a policy.

    Attributes:
        trained_splits: Splits that either was trained on.

    Raises:
        PolicyError: The target has no policy, or the trackers' one plans ahead in copies of the
            worlds, which have no target's policy.
    """

    def __init__(self, policy: Policy, target: Target) -> None:
        if target.policy is None:
            raise PolicyError(f"target {target.name!r} is a motion of the scenario, not a policy")
        if policy.reads_state:
            raise PolicyError(
                f"{policy.name!r} reads the state and plays the target's motion ahead: it cannot "
                f"play against {target.name!r}, which is moved by a policy"
            )
        self.name = policy.name
        self.message_size = policy.message_size
        splits = (*getattr(policy, "trained_splits", ()), *target.trained_splits)
        self.trained_splits = tuple(dict.fromkeys(splits))
        self.policy, self.target = policy, target.policy
        self.reads_state = isinstance(self.target, StateReader) and self.target.reads_state  # of the team: False
        self._target_name = target.name

    def begin(self, layout: ObservationLayout, num_worlds: int) -> Memory:
        """Return the memories of both.

        Raises:
            PolicyError: Either does not fit the layout.
        """
        return self.policy.begin(layout, num_worlds), self.target.begin(layout, num_worlds)

    def watch(self, batch: Batch) -> None:
        """Set the batch of a target that reads the state."""
        if isinstance(self.target, StateReader):
            self.target.watch(batch)

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return actions (E, N + 1, 2 + m) for observations (E, N + 1, F)."""
        mine, theirs = memory
        actions, mine = self.policy.act(np.ascontiguousarray(observations[:, :-1]), mine)
        moves, theirs = self.target.act(np.ascontiguousarray(observations[:, -1:]), theirs)
        moves = np.asarray(moves)
        if moves.shape[:2] != (len(actions), 1) or moves.shape[-1] < 2:
            raise PolicyError(
                f"target {self._target_name!r} returned actions of shape {moves.shape}, wanted {(len(actions), 1, 2)}"
            )
        whole = np.zeros((len(actions), observations.shape[1], actions.shape[2]), np.float32)
        whole[:, :-1] = actions
        whole[:, -1, :2] = moves[:, 0, :2]
        return whole, (mine, theirs)

    def restart(self, memory: Memory, mask: BoolArray) -> Memory:
        """Return the memories with the worlds of a mask (E,) restarted."""
        return self.policy.restart(memory[0], mask), self.target.restart(memory[1], mask)

    def annotations(self, memory: Memory) -> Annotations:
        """Return those of the trackers' policy."""
        return self.policy.annotations(memory[0])

    def leaders(self, memory: Memory) -> npt.NDArray[Any] | None:
        """Return the leader of each tracker, as the trackers' policy says."""
        if isinstance(self.policy, BasePolicy):
            return self.policy.leaders(memory[0])
        return super().leaders(memory)


def against(policy: Policy, target: Target | None) -> Policy:
    """Return what plays a policy against a target, in ``target.fit(scenario)``.

    That is the policy itself where the target is a scripted motion, or ``None``, the scenario's
    own.

    Raises:
        PolicyError: As :class:`Match`.
    """
    return policy if target is None or target.policy is None else Match(policy, target)
