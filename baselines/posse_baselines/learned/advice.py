"""A scripted adviser beside a learned policy (residual policy learning).

At each step the adviser proposes a motion. The network reads the proposal together with the
observation; the action is the proposal plus twice the network's output, clipped to [-1, 1]. An
output of zero reproduces the adviser, and every action stays reachable. The adviser's messages are
sent unchanged, and its memory is its own, so the network needs no memory. References: Silver et
al. 2018, Johannink et al. 2019.
"""

from __future__ import annotations

from typing import Any, Final, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from posse import Batch
from posse.numeric import BoolArray, FloatArray
from posse_baselines.policy import Memory, Policy, PolicyError, begin

REACH: Final = np.float32(2.0)
"""Factor of the network's output: spans the whole of [-1, 1] from either end."""
MOTION: Final = 2
"""Numbers of an action that move the tracker; a proposal adds as many inputs."""


@runtime_checkable
class Adviser(Policy, Protocol):
    """A policy whose memory can be saved, as resuming a training run requires."""

    def arrays(self, memory: Memory) -> dict[str, npt.NDArray[Any]]:
        """Return the memory as arrays (E, ...) by name; views, not copies."""
        ...


def check_adviser(name: str, policy: Policy) -> Adviser:
    """Return a policy as an adviser.

    Raises:
        PolicyError: It reads the state of the worlds, or its memory cannot be saved.
    """
    if policy.reads_state:
        raise PolicyError(
            f"{name!r} cannot be an adviser: it reads the state of the worlds, which no tracker "
            "observes"
        )
    if not isinstance(policy, Adviser):
        raise PolicyError(f"{name!r} cannot be an adviser: it has no method arrays(memory)")
    return policy


def advised(proposals: FloatArray, outputs: FloatArray) -> FloatArray:
    """Return actions (..., 2 + m) for proposals (..., 2 + m) and network outputs (..., 2)."""
    actions = proposals.copy()
    actions[..., :MOTION] += REACH * outputs
    return np.clip(actions, np.float32(-1.0), np.float32(1.0))


class Advice:
    """The adviser's memory and latest proposals for one batch.

    Args:
        adviser: The policy that proposes.
        batch: The worlds; their episodes may begin at different times.

    Attributes:
        proposals: (E, N, 2 + m), for the latest observations.
    """

    def __init__(self, adviser: Adviser, batch: Batch) -> None:
        self._adviser = adviser
        self._memory = begin(adviser, batch)
        worlds, trackers = batch.num_worlds, batch.scenario.num_trackers
        self.proposals = np.zeros(
            (worlds, trackers, MOTION + batch.scenario.message_size), np.float32
        )

    def follow(self, observations: FloatArray) -> None:
        """Compute proposals for the observations (E, N, F) after a step."""
        proposals, self._memory = self._adviser.act(observations, self._memory)
        self.proposals[...] = proposals

    def restart(self, observations: FloatArray, mask: BoolArray) -> None:
        """Compute proposals for the first observations of the worlds in a mask (E,)."""
        others = ~mask
        kept = {name: array[others] for name, array in self.arrays().items()}
        self._memory = self._adviser.restart(self._memory, mask)
        self.follow(observations)
        for name, array in self.arrays().items():
            array[others] = kept[name]

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Return the adviser's memory and the proposals as arrays by name; views, not copies."""
        return {**self._adviser.arrays(self._memory), "proposals": self.proposals}
