"""The interface of a policy.

A policy drives the whole team, batch first (E worlds, N trackers, F numbers an observation, m numbers a message)::

    memory = policy.begin(batch.layout, batch.num_worlds)
    actions, memory = policy.act(observations, memory)      # (E, N, F) -> (E, N, 2 + m)
    memory = policy.restart(memory, mask)                   # worlds whose episode restarts

All that a policy remembers is in ``memory``: one policy object may play any number of batches. The
memory passed to ``act`` or ``restart`` must not be used again; use the one that is returned.
"""

import reprlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from posse import Batch, ObservationLayout, TargetPolicy
from posse.adapters.actions import as_motions
from posse.numeric import BoolArray, FloatArray
from posse.scenarios.setting import check_count

Memory = Any
"""What a policy remembers of its worlds; opaque to all but the policy."""
Annotations = dict[str, npt.NDArray[Any]]
"""Internal quantities of the trackers by name, (E, N) or (E, N, k), for drawing and tests."""


class PolicyError(ValueError):
    """A policy that is unknown, damaged, or does not fit the scenario."""


@runtime_checkable
class Policy(TargetPolicy, Protocol):
    """Drives a team of trackers, with the methods of :class:`posse.TargetPolicy`, for N robots instead of one.

    Attributes:
        name: Its name in results.
        message_size: Numbers that it adds to each broadcast; the scenario's ``message_size`` must be at least that.
        reads_state: Whether it reads the state of the worlds, which no tracker observes. Such a
            policy is a reference; :func:`begin` shows it the batch by its method ``watch(batch)``.
    """

    name: str
    message_size: int
    reads_state: bool

    def annotations(self, memory: Memory) -> Annotations:
        """Return internal quantities of the trackers; empty if there are none."""


class BasePolicy:
    """Defaults of most policies: no memory beyond the layout, no messages, no annotations."""

    name: str = ""
    message_size: int = 0
    reads_state: bool = False

    def begin(self, layout: ObservationLayout, num_worlds: int) -> Memory:
        """Return the memory of ``num_worlds`` worlds, the layout; PolicyError if the messages are too short."""
        available = layout.scenario.message_size
        if available < self.message_size:
            raise PolicyError(
                f"policy {self.name!r} adds {self.message_size} numbers to each broadcast, but scenario "
                f"{layout.scenario.name!r} has message_size={available}: make the worlds with "
                f"message_size={self.message_size}"
            )
        return layout

    def restart(self, memory: Memory, mask: BoolArray) -> Memory:
        """Return the memory with the worlds of a mask (E,) restarted."""
        if hasattr(memory, "restart"):
            memory.restart(mask)
        elif not isinstance(memory, (ObservationLayout, type(None))):
            raise PolicyError(f"policy {self.name!r} must forget a world that restarts: define restart(memory, mask)")
        return memory

    def annotations(self, memory: Memory) -> Annotations:
        """Return internal quantities of the trackers."""
        return {}

    def arrays(self, memory: Memory) -> dict[str, npt.NDArray[Any]]:
        """Return the memory as arrays (E, ...) by name; views, not copies. PolicyError if it is of an unknown kind."""
        if memory is None or isinstance(memory, ObservationLayout):  # as of :meth:`begin` here: nothing is remembered
            return {}
        if not hasattr(memory, "arrays"):
            raise PolicyError(f"the memory of policy {self.name!r} cannot be saved: define its method arrays(memory)")
        return dict(memory.arrays())

    def __repr__(self) -> str:
        return f"<policy {self.name!r}>"


def check_observations(observations: npt.ArrayLike, robots: tuple[int, ...], layout: ObservationLayout) -> FloatArray:
    """Return the observations of robots (E, R) as kernels take them; PolicyError if they are not (E, R, F)."""
    array = np.ascontiguousarray(observations, np.float32)
    wanted = (*robots, layout.size)
    if array.shape != wanted:
        raise PolicyError(
            f"a policy got observations of shape {array.shape}, wanted {wanted}: "
            "(worlds, robots it moves, observation length) of the layout that begin() was given"
        )
    return array


def check_policy(policy: object) -> None:
    """Raise TypeError for what is no policy, PolicyError for one of a target."""
    if isinstance(policy, type) or not isinstance(policy, Policy):
        make = "load() makes one of a name, from_function() of a function; your own class extends BasePolicy"
        raise TypeError(f"{policy!r:.100} is no policy: it lacks what posse_baselines.Policy has; {make}")
    if getattr(policy, "side", "trackers") == "target":
        raise PolicyError(f"policy {policy.name!r} moves a target: give it as target=, or --target")


def begin(policy: Policy, batch: Batch) -> Memory:
    """Return the memory of a policy for a batch; a policy with ``reads_state = True`` first gets the batch.

    TypeError for what is no policy, such as a name.
    """
    check_policy(policy)
    if policy.reads_state and hasattr(policy, "watch"):
        policy.watch(batch)
    return policy.begin(batch.layout, batch.num_worlds)


class from_function(BasePolicy):  # noqa: N801 (used as a function is)
    """A policy that calls a function, for all that takes a policy.

    Args:
        function: Observations (E, N, F) float32 -> actions (E, N, 2) in [-1, 1], or (E, N, 2 + m).
            It has no memory of earlier steps.
        name: Its name in results; default: the function's.
        message_size: Numbers that it adds to each broadcast, m.
        discrete_actions: Whether it returns numbers (E, N) of
            :data:`posse.adapters.actions.MOTIONS`.
    """

    def __init__(
        self,
        function: Callable[[FloatArray], npt.ArrayLike],
        *,
        name: str | None = None,
        message_size: int = 0,
        discrete_actions: bool = False,
    ) -> None:
        if not callable(function):
            raise TypeError(f"from_function takes a function, got {reprlib.repr(function)}")
        self.name = getattr(function, "__name__", "function") if name is None else name
        self.message_size = check_count("message_size", message_size, 0)
        self._function = function
        self._discrete = discrete_actions

    def act(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return the function's actions, (E, N, 2 + m), and the memory; ValueError if they have another shape."""
        found = np.asarray(self._function(observations))
        team, length = observations.shape[:2], 2 + memory.scenario.message_size
        own = found.shape[-1] if found.shape[-1:] in ((2,), (length,)) else 2 + self.message_size
        shape = team if self._discrete else (*team, own)
        chosen = as_motions(f"what the function of policy {self.name!r} returned", found, shape, self._discrete)
        actions = np.zeros((*team, length), np.float32)
        actions[..., : chosen.shape[2]] = chosen
        return actions, memory


def stack_agents(observations: Mapping[str, npt.ArrayLike]) -> FloatArray:
    """Return the trackers' observations of a parallel environment as a batch of one, (1, N, F).

    Trackers are sorted by number, ``tracker_0`` first; a target that is an agent is left out.
    """
    count = sum(name.startswith("tracker_") for name in observations)
    if count == 0:
        raise ValueError(f"no tracker among {list(observations)}: give the observations of an episode that goes on")
    return np.stack([np.asarray(observations[f"tracker_{i}"], np.float32) for i in range(count)])[None]


def split_agents(actions: FloatArray, agents: Sequence[str] | Mapping[str, Any]) -> dict[str, FloatArray]:
    """Return actions (1, N, 2 + m) by name, for the trackers among ``agents``."""
    return {name: actions[0, int(name.removeprefix("tracker_"))] for name in agents if name.startswith("tracker_")}
