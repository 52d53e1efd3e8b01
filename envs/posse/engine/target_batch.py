"""Batches in which a policy moves the target."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from posse.engine.batch import Batch, Snapshot
from posse.engine.kernels import MOST_ACTION
from posse.numeric import BoolArray, FloatArray
from posse.scenarios import Scenario, ScenarioError
from posse.shown import shown
from posse.signals.observation.layout import ObservationLayout


@runtime_checkable
class TargetPolicy(Protocol):
    """Moves the target of every world; it observes the trackers without error.

    A policy of one robot: what the target observes has the fields of a tracker's observation, with
    the trackers in the places of team-mates. What the policy remembers is in its memory.
    """

    def begin(self, layout: ObservationLayout, num_worlds: int) -> Any:
        """Return the memory for the first step of ``num_worlds`` worlds."""
        ...

    def act(self, observations: FloatArray, memory: Any) -> tuple[FloatArray, Any]:
        """Return actions (E, 1, 2 or more) in [-1, 1] for observations (E, 1, F), and the memory.

        The first two numbers of an action are the target's speed and turn rate.
        """
        ...

    def restart(self, memory: Any, mask: BoolArray) -> Any:
        """Return the memory with the worlds of a mask (E,) reset to those of :meth:`begin`."""
        ...


class TargetBatch(Batch):
    """A batch whose target is moved by a policy; all else is as in :class:`Batch`.

    Observations, actions and rewards have a row for each tracker only.

    Args:
        scenario: Settings of the worlds; ``target_motion`` must be ``"agent"``.
        num_worlds: E, at least 1.
        target_policy: Moves the target.
        **settings: Further arguments of :class:`Batch`.

    Raises:
        ScenarioError: As :class:`Batch`, or a target that is not an agent.
        TypeError: ``target_policy`` lacks a method of :class:`TargetPolicy`.
    """

    def __init__(
        self, scenario: Scenario, num_worlds: int, *, target_policy: TargetPolicy, **settings: Any
    ) -> None:
        check_target_policy(target_policy)
        if scenario.target_motion != "agent":
            raise ScenarioError(
                f"target_policy= needs a target that is an agent, not "
                f"target_motion={scenario.target_motion!r}: make the scenario with target='agent'"
            )
        super().__init__(scenario, num_worlds, **settings)
        n = scenario.num_trackers
        self.observation_shape = (num_worlds, n, self.layout.size)
        self.action_shape = (num_worlds, n, self.action_shape[2])
        self.target_policy = target_policy
        self._memory = target_policy.begin(self.layout, num_worlds)
        self._seen = np.zeros((num_worlds, 1, self.layout.size), np.float32)

    @property
    def target_memory(self) -> Any:
        """The memory of the target's policy."""
        return self._memory

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> FloatArray:
        """Start an episode in every world; see :meth:`Batch.reset`."""
        observations = super().reset(seed=seed, options=options)
        mask = (options or {}).get("reset_mask")
        everywhere = np.ones(self.num_worlds, np.bool_)
        return self._look(observations, everywhere if mask is None else np.asarray(mask, np.bool_))

    def step(
        self, actions: npt.ArrayLike
    ) -> tuple[FloatArray, FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """Advance every world by one control step; see :meth:`Batch.step`.

        Raises:
            ValueError: As :meth:`Batch.step`, or invalid actions of the target's policy.
        """
        self._check_running()
        mine = self.check_actions(actions)
        n = self.scenario.num_trackers
        whole = np.empty((self.num_worlds, n + 1, self.action_shape[2]), np.float32)
        whole[:, :n] = mine
        restarted = self._act(whole)
        observations, rewards, terminated, truncated, infos = self._step_checked(whole)
        if self.autoreset == "same_step":
            restarted = terminated | truncated
        terms = {name: array[:, :n] for name, array in infos["reward_terms"].items()}
        infos["reward_terms"] = terms
        if "final_obs" in infos:
            infos["final_obs"] = np.ascontiguousarray(infos["final_obs"][:, :n])
        return (
            self._look(observations, restarted), np.ascontiguousarray(rewards[:, :n]),
            terminated, truncated, infos,
        )  # fmt: skip

    def observe(self) -> FloatArray:
        """Return the current observations of the trackers, (E, N, F)."""
        return self._look(super().observe())

    def restore(self, snapshot: Snapshot) -> FloatArray:
        """Restore a snapshot; see :meth:`Batch.restore`. The policy's memory is not part of it."""
        return self._look(super().restore(snapshot))

    def copies(
        self, count: int, *, seed: int = 0, alike: bool = False, into: Batch | None = None
    ) -> Batch:
        """Raise: a plan would need the target's policy.

        Raises:
            ValueError: Always.
        """
        raise ValueError("a batch with target_policy= cannot be copied for planning ahead")

    def _stepper(
        self,
        actions: FloatArray,
        observations: FloatArray,
        rewards: FloatArray,
        terms: FloatArray,
    ) -> Callable[[], int]:
        n = self.scenario.num_trackers

        def with_target(array: FloatArray) -> FloatArray:
            return np.zeros((len(array), n + 1, *array.shape[2:]), np.float32)

        whole = [with_target(array) for array in (actions, observations, rewards, terms)]
        advance = super()._stepper(*whole)
        written = list(zip((observations, rewards, terms), whole[1:], strict=True))

        def step() -> int:
            whole[0][:, :n] = actions
            restarted = self._act(whole[0])
            over = advance()
            for mine, array in written:
                mine[...] = array[:, :n]
            self._look(whole[1], restarted)
            return over

        return step

    def _act(self, whole: FloatArray) -> BoolArray:
        """Write the target's actions to the last row; return which worlds the step restarts."""
        chosen, self._memory = self.target_policy.act(self._seen, self._memory)
        chosen = np.asarray(chosen)
        wanted = (self.num_worlds, 1)
        if chosen.ndim != 3 or chosen.shape[:2] != wanted or chosen.shape[2] < 2:
            raise ValueError(
                f"the target's policy returned actions of shape {chosen.shape}, wanted "
                f"{(*wanted, 2)}"
            )
        motion = chosen[:, 0, :2]
        if not (np.abs(motion) <= MOST_ACTION).all():  # also where one is not a number
            raise ValueError(
                f"the target's policy returned an action of {motion[~(np.abs(motion) <= 1)][0]}: "
                "it must be a number in [-1, 1]"
            )
        whole[:, -1] = 0
        whole[:, -1, :2] = np.clip(motion, -1, 1)
        return np.asarray(self._arrays.world["over"] != 0)

    def _look(self, observations: FloatArray, restarted: BoolArray | None = None) -> FloatArray:
        """Keep what the target observes; return the trackers' observations (E, N, F)."""
        if restarted is not None and restarted.any():
            self._memory = self.target_policy.restart(self._memory, restarted)
        self._seen = np.ascontiguousarray(observations[:, -1:])
        return np.ascontiguousarray(observations[:, :-1])


def check_target_policy(policy: Any) -> None:
    """Raise if an object is not a target's policy.

    Raises:
        TypeError: The message names the missing methods.
    """
    missing = [name for name in ("begin", "act", "restart") if not hasattr(policy, name)]
    if missing:
        raise TypeError(
            f"target_policy={shown(policy)} is not the policy of a target: it has no "
            f"{', '.join(missing)} (posse.TargetPolicy)"
        )


def with_agent(scenario: Scenario, policy: TargetPolicy | None) -> Scenario:
    """Return a scenario whose target is an agent if a policy moves it, else the scenario.

    Raises:
        TypeError: Not the policy of a target.
    """
    if policy is None:
        return scenario
    check_target_policy(policy)
    return scenario.replace(target_motion="agent")


def batch_for(
    scenario: Scenario, num_worlds: int, policy: TargetPolicy | None, **settings: Any
) -> Batch:
    """Return a batch whose target is moved by a policy, if there is one; see :class:`Batch`."""
    if policy is None:
        return Batch(scenario, num_worlds, **settings)
    return TargetBatch(scenario, num_worlds, target_policy=policy, **settings)
