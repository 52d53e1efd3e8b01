"""Batches in which a policy moves one side: the target, or the trackers."""

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


class PairedBatch(Batch):
    """A batch whose trackers, or whose target, are moved by a policy inside.

    Observations, actions and rewards have a row for each robot of the other side only; all else is
    as in :class:`Batch`. The policy inside keeps its memory between the steps; a snapshot does not
    contain it.

    Args:
        scenario: Settings of the worlds; ``target_motion`` must be ``"agent"``.
        num_worlds: E, at least 1.
        inside: Moves its side; ``begin``, ``act`` and ``restart`` as :class:`TargetPolicy` has
            them, with a row for each robot that it moves.
        moves_target: Whether its side is the target, else the trackers.
        **settings: Further arguments of :class:`Batch`.

    Attributes:
        inside: The policy inside.
        moves_target: Whether it moves the target.

    Raises:
        ScenarioError: As :class:`Batch`, or a target that is not an agent.
        TypeError: ``inside`` lacks a method.
    """

    def __init__(
        self, scenario: Scenario, num_worlds: int, inside: TargetPolicy, *, moves_target: bool, **settings: Any
    ) -> None:
        self._side = "target" if moves_target else "team"
        check_inside(inside, self._side)
        if scenario.target_motion != "agent":
            raise ScenarioError(
                f"{self._side}_policy= needs a target that is an agent, not "
                f"target_motion={scenario.target_motion!r}: make the scenario with target='agent'"
            )
        super().__init__(scenario, num_worlds, **settings)
        n = scenario.num_trackers
        trackers, target = slice(0, n), slice(n, n + 1)
        self._mine, self._theirs = (trackers, target) if moves_target else (target, trackers)
        # A target sends no messages.
        self._length, self._their_length = self.action_shape[2], 2 if moves_target else None
        rows = self._mine.stop - self._mine.start
        self.observation_shape = (num_worlds, rows, self.layout.size)
        self.action_shape = (num_worlds, rows, self._length if moves_target else 2)
        self.inside, self.moves_target = inside, moves_target
        self._memory = inside.begin(self.layout, num_worlds)
        self._seen = np.zeros((num_worlds, n + 1 - rows, self.layout.size), np.float32)

    @property
    def memory_inside(self) -> Any:
        """The memory of the policy inside."""
        return self._memory

    def reset(self, *, seed: int | None = None, options: Mapping[str, Any] | None = None) -> FloatArray:
        """Start an episode in every world; see :meth:`Batch.reset`."""
        observations = super().reset(seed=seed, options=options)
        mask = (options or {}).get("reset_mask")
        everywhere = np.ones(self.num_worlds, np.bool_)
        return self._look(observations, everywhere if mask is None else np.asarray(mask, np.bool_))

    def step(self, actions: npt.ArrayLike) -> tuple[FloatArray, FloatArray, BoolArray, BoolArray, dict[str, Any]]:
        """Advance every world by one control step; see :meth:`Batch.step`.

        Raises:
            ValueError: As :meth:`Batch.step`, or invalid actions of the policy inside.
        """
        self._check_running()
        checked = self.check_actions(actions)
        whole = self._of_all(self._length)
        whole[:, self._mine, : checked.shape[2]] = checked
        restarted = self._act(whole)
        observations, rewards, terminated, truncated, infos = self._step_checked(whole)
        if self.autoreset == "same_step":
            restarted = terminated | truncated
        infos["reward_terms"] = {name: array[:, self._mine] for name, array in infos["reward_terms"].items()}
        if "final_obs" in infos:
            infos["final_obs"] = np.ascontiguousarray(infos["final_obs"][:, self._mine])
        return (
            self._look(observations, restarted),
            np.ascontiguousarray(rewards[:, self._mine]),
            terminated,
            truncated,
            infos,
        )

    def observe(self) -> FloatArray:
        """Return the current observations, (E, rows, F)."""
        return self._look(super().observe())

    def restore(self, snapshot: Snapshot) -> FloatArray:
        """Restore a snapshot; see :meth:`Batch.restore`."""
        return self._look(super().restore(snapshot))

    def copies(self, count: int, *, seed: int = 0, alike: bool = False, into: Batch | None = None) -> Batch:
        """Raise: a plan would need the policy inside.

        Raises:
            ValueError: Always.
        """
        raise ValueError(
            f"a batch with {self._side}_policy= cannot be copied for planning ahead: the copies "
            "would lack that policy's memory"
        )

    def _stepper(
        self, actions: FloatArray, observations: FloatArray, rewards: FloatArray, terms: FloatArray
    ) -> Callable[[], int]:
        whole = self._of_all(self._length)
        outputs = [self._of_all(*array.shape[2:]) for array in (observations, rewards, terms)]
        advance = super()._stepper(whole, *outputs)
        written = list(zip((observations, rewards, terms), outputs, strict=True))

        def step() -> int:
            whole[:, self._mine, : actions.shape[2]] = actions
            restarted = self._act(whole)
            over = advance()
            for mine, array in written:
                mine[...] = array[:, self._mine]
            self._look(outputs[0], restarted)
            return over

        return step

    def _of_all(self, *shape: int) -> FloatArray:
        """Return zeros for every agent of every world, (E, N + 1, *shape)."""
        return np.zeros((self.num_worlds, self.scenario.num_agents, *shape), np.float32)

    def _act(self, whole: FloatArray) -> BoolArray:
        """Write the actions of the policy inside; return which worlds the step restarts."""
        chosen, self._memory = self.inside.act(self._seen, self._memory)
        chosen = np.asarray(chosen)
        wanted = (*self._seen.shape[:2], self._their_length or self._length)
        if chosen.shape[:2] != wanted[:2] or chosen.ndim != 3 or chosen.shape[2] < wanted[2]:
            raise ValueError(f"the {self._side}'s policy returned actions of shape {chosen.shape}, wanted {wanted}")
        chosen = chosen[:, :, : wanted[2]]
        outside = ~(np.abs(chosen) <= MOST_ACTION)  # also where one is not a number
        if outside.any():
            raise ValueError(
                f"the {self._side}'s policy returned {chosen[outside][0]} in an action: it must be a number in [-1, 1]"
            )
        whole[:, self._theirs, : wanted[2]] = np.clip(chosen, -1, 1)
        return np.asarray(self._arrays.world["over"] != 0)

    def _look(self, observations: FloatArray, restarted: BoolArray | None = None) -> FloatArray:
        """Keep what the policy inside observes; return the other observations, (E, rows, F)."""
        if restarted is not None and restarted.any():
            self._memory = self.inside.restart(self._memory, restarted)
        self._seen = np.ascontiguousarray(observations[:, self._theirs])
        return np.ascontiguousarray(observations[:, self._mine])


def check_inside(policy: Any, side: str) -> None:
    """Raise if an object cannot move a side.

    Raises:
        TypeError: The message names the missing methods.
    """
    missing = [name for name in ("begin", "act", "restart") if not hasattr(policy, name)]
    if missing:
        raise TypeError(
            f"{side}_policy={shown(policy)} is not the policy of a {side}: it has no "
            f"{', '.join(missing)} (posse.TargetPolicy)"
        )


def with_agent(scenario: Scenario, policy: TargetPolicy | None, side: str = "target") -> Scenario:
    """Return a scenario whose target is an agent if there is a policy, else the scenario.

    Raises:
        TypeError: Not the policy of a side.
    """
    if policy is None:
        return scenario
    check_inside(policy, side)
    return scenario.replace(target_motion="agent")


def batch_for(scenario: Scenario, num_worlds: int, policy: TargetPolicy | None, **settings: Any) -> Batch:
    """Return a batch whose target is moved by a policy, if there is one; see :class:`Batch`."""
    if policy is None:
        return Batch(scenario, num_worlds, **settings)
    return PairedBatch(scenario, num_worlds, policy, moves_target=True, **settings)
