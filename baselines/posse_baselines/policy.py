"""What a policy is, and how one is played: in a batch, or beside a PettingZoo environment.

A policy drives the whole team, batch first (E worlds, N trackers, F numbers an observation, m
numbers a message)::

    memory = policy.begin(batch.layout, batch.num_worlds)
    actions, memory = policy.act(observations, memory)      # (E, N, F) -> (E, N, 2 + m)
    memory = policy.restart(memory, mask)                   # worlds whose episode begins anew

What a policy remembers is in ``memory`` alone: one policy object may play in any number of batches.
The memory given to ``act`` or ``restart`` is used up: go on with the one that is returned.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from posse import Batch, ObservationLayout
from posse.numeric import BoolArray, FloatArray

Memory = Any
"""What a policy remembers of its worlds; only the policy itself looks into it."""
Annotations = dict[str, npt.NDArray[Any]]
"""What trackers have in mind, by name, (E, N) or (E, N, k) each; for drawing and for tests."""


class PolicyError(ValueError):
    """A policy that cannot play in the place it was given."""


@runtime_checkable
class Policy(Protocol):
    """Whatever drives a team of trackers.

    Attributes:
        name: What results call it.
        message_size: Numbers that it adds to each broadcast; the scenario's ``message_size`` has to
            be at least that.
        reads_state: Whether it reads the state of the worlds, which no tracker could know. Such a
            policy is a reference, and has to be shown the batch (:func:`begin` does so).
    """

    name: str
    message_size: int
    reads_state: bool

    def begin(self, layout: ObservationLayout, num_worlds: int) -> Memory:
        """Return the memory for the first step of ``num_worlds`` worlds.

        Raises:
            PolicyError: The layout lacks something that the policy needs.
        """
        ...

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return actions (E, N, 2 + m) in [-1, 1] for observations (E, N, F), and the memory."""
        ...

    def restart(self, memory: Memory, mask: BoolArray) -> Memory:
        """Return the memory with the worlds of a mask (E,) as :meth:`begin` made them."""
        ...

    def annotations(self, memory: Memory) -> Annotations:
        """Return what the trackers have in mind; empty where there is nothing to tell."""
        ...


@runtime_checkable
class StateReader(Policy, Protocol):
    """A policy that reads the state of the worlds."""

    def watch(self, batch: Batch) -> None:
        """Take the batch whose state is to be read from now on."""
        ...


class BasePolicy:
    """What most policies have in common: nothing to remember, nothing to say."""

    name: str = ""
    message_size: int = 0
    reads_state: bool = False

    def begin(self, layout: ObservationLayout, num_worlds: int) -> Memory:
        """Check that the layout fits, and return the memory of ``num_worlds`` worlds."""
        check_fits(self, layout)
        return layout

    def restart(self, memory: Memory, mask: BoolArray) -> Memory:
        """Return the memory with the worlds of a mask (E,) begun anew."""
        return memory

    def annotations(self, memory: Memory) -> Annotations:
        """Return what the trackers have in mind."""
        return {}

    def leaders(self, memory: Memory) -> npt.NDArray[Any] | None:
        """Return whom each tracker follows, (E, N), -1 for nobody; ``None``: there is no lead."""
        return self.annotations(memory).get("leader")

    def arrays(self, memory: Memory) -> dict[str, npt.NDArray[Any]]:
        """Return what the policy remembers, as arrays (E, ...) by name that share its memory."""
        return {}

    def __repr__(self) -> str:
        return f"<policy {self.name!r}>"


def message_size_of(layout: ObservationLayout) -> int:
    """Return m, how many numbers a policy may add to each broadcast."""
    return layout.scenario.message_size


def check_fits(policy: Policy | BasePolicy, layout: ObservationLayout) -> None:
    """Raise if a policy has more to say than the scenario's messages hold.

    Raises:
        PolicyError: ``message_size`` of the scenario is too small.
    """
    available = message_size_of(layout)
    if available < policy.message_size:
        raise PolicyError(
            f"policy {policy.name!r} adds {policy.message_size} numbers to each broadcast, but "
            f"scenario {layout.scenario.name!r} has message_size={available}: make the worlds with "
            f"message_size={policy.message_size}"
        )


def check_observations(
    policy: Policy | BasePolicy,
    observations: npt.ArrayLike,
    num_worlds: int,
    layout: ObservationLayout,
) -> FloatArray:
    """Return the observations as kernels take them.

    Raises:
        PolicyError: They are not (E, N, F) of the layout that the memory was made for.
    """
    array = np.ascontiguousarray(observations, np.float32)
    wanted = (num_worlds, layout.scenario.num_trackers, layout.size)
    if array.shape != wanted:
        raise PolicyError(
            f"policy {policy.name!r} got observations of shape {array.shape}, wanted {wanted}: "
            "(worlds, trackers, observation length) of the layout that begin() was given"
        )
    return array


def begin(policy: Policy, batch: Batch) -> Memory:
    """Return the memory of a policy for a batch; one that reads the state is shown the batch.

    Raises:
        PolicyError: The policy does not fit the batch.
    """
    if isinstance(policy, StateReader):
        policy.watch(batch)
    return policy.begin(batch.layout, batch.num_worlds)


# --- a batch -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Played:
    """One control step that was played."""

    actions: FloatArray
    """(E, N, 2 + m), what the policy chose."""
    observations: FloatArray
    """(E, N, F), after the step."""
    rewards: FloatArray
    terminated: BoolArray
    truncated: BoolArray
    infos: dict[str, Any]
    memory: Memory
    """The policy's, before it acts on ``observations``."""


def rollout(batch: Batch, policy: Policy, *, seed: int | None = None) -> Iterator[Played]:
    """Reset a batch and play it without end, one :class:`Played` a control step.

    With autoreset disabled it ends when every world has; otherwise the caller stops.

    Raises:
        PolicyError: The policy does not fit the batch, or the target is an agent, too.
    """
    if batch.scenario.num_agents != batch.scenario.num_trackers:
        raise PolicyError(
            f"the target of {batch.scenario.name!r} is an agent, and a policy drives trackers only"
        )
    memory = begin(policy, batch)
    observations = batch.reset(seed=seed)
    begins = np.zeros(batch.num_worlds, np.bool_)
    while True:
        actions, memory = policy.act(observations, memory)
        observations, rewards, terminated, truncated, infos = batch.step(actions)
        ended = terminated | truncated
        # In the mode "next_step", the step after the end is what begins the next episode.
        begins = begins if batch.autoreset == "next_step" else ended
        if begins.any():
            memory = policy.restart(memory, begins)
        begins = ended
        yield Played(actions, observations, rewards, terminated, truncated, infos, memory)
        if batch.autoreset == "disabled" and ended.any():
            if not ended.all():
                raise PolicyError(
                    "episodes of this batch end at different steps: play it with an autoreset mode"
                )
            return


def play(
    batch: Batch, policy: Policy, *, seed: int | None = None
) -> dict[str, npt.NDArray[np.float64]]:
    """Play one episode in every world and return its metrics by name, (E,) each.

    Raises:
        PolicyError: The policy does not fit the batch.
    """
    metrics: dict[str, npt.NDArray[np.float64]] = {}
    waiting = np.ones(batch.num_worlds, np.bool_)
    for step in rollout(batch, policy, seed=seed):
        if "metrics" not in step.infos:
            continue
        ended = waiting & step.infos["_metrics"]
        for name, values in step.infos["metrics"].items():
            column = metrics.setdefault(name, np.full(batch.num_worlds, np.nan))
            column[ended] = values[ended]
        waiting &= ~ended
        if not waiting.any():
            break
    return metrics


# --- PettingZoo ----------------------------------------------------------------------------------


def stack_agents(observations: Mapping[str, npt.ArrayLike]) -> FloatArray:
    """Return the trackers' observations of a parallel environment as a batch of one, (1, N, F).

    Trackers are taken by number, ``tracker_0`` first, whatever the order of the mapping; a target
    that is an agent is left out.

    Raises:
        PolicyError: There is no tracker, or one is missing.
    """
    names = [name for name in observations if name.startswith("tracker_")]
    wanted = [f"tracker_{i}" for i in range(len(names))]
    if not names or set(names) != set(wanted):
        raise PolicyError(
            f"observations of {sorted(observations)} are not those of a team: "
            "tracker_0, tracker_1, ... without a gap"
        )
    return np.stack([np.asarray(observations[name], np.float32) for name in wanted])[None]


def split_agents(
    actions: FloatArray, agents: Sequence[str] | Mapping[str, Any]
) -> dict[str, FloatArray]:
    """Return actions (1, N, 2 + m) by name, for the trackers among ``agents``."""
    return {
        name: actions[0, int(name.removeprefix("tracker_"))]
        for name in agents
        if name.startswith("tracker_")
    }
