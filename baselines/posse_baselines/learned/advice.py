"""A scripted policy that a learned one listens to.

At each step the adviser proposes a motion. The learner's network is given the proposal beside the
observation, and what it answers is added: its action is the proposal plus twice the answer, cut to
[-1, 1]. An answer of zero is the adviser itself, and no action is out of reach. The adviser's
messages go out as they are, and what it remembers is its own: so the learner needs no memory, and
begins where the script ends (residual policy learning: Silver et al. 2018, Johannink et al. 2019).
"""

from __future__ import annotations

from typing import Any, Final, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from posse import Batch
from posse.numeric import BoolArray, FloatArray
from posse_baselines.policy import Memory, Policy, PolicyError, begin

REACH: Final = np.float32(2.0)
"""What the network's answer is multiplied by: from one end of [-1, 1] to the other."""
MOTION: Final = 2
"""Numbers of an action that move the tracker, and that a proposal adds to the inputs."""


@runtime_checkable
class Adviser(Policy, Protocol):
    """A policy that can say what it remembers, so that a training can be cut and gone on with."""

    def arrays(self, memory: Memory) -> dict[str, npt.NDArray[Any]]:
        """Return what it remembers, as arrays (E, ...) by name that share its memory."""
        ...


def check_adviser(name: str, policy: Policy) -> Adviser:
    """Return a policy as an adviser.

    Raises:
        PolicyError: It reads the state of the worlds, or cannot say what it remembers.
    """
    if policy.reads_state:
        raise PolicyError(f"{name!r} cannot advise: it reads what no tracker can know")
    if not isinstance(policy, Adviser):
        raise PolicyError(f"{name!r} cannot advise: it has no method arrays(memory)")
    return policy


def advised(proposals: FloatArray, answers: FloatArray) -> FloatArray:
    """Return actions (..., 2 + m) from proposals (..., 2 + m) and a network's answers (..., 2)."""
    actions = proposals.copy()
    actions[..., :MOTION] += REACH * answers
    return np.clip(actions, np.float32(-1.0), np.float32(1.0))


class Advice:
    """An adviser at work in a batch.

    Args:
        adviser: Who proposes.
        batch: The worlds, in which episodes begin at different times.

    Attributes:
        proposals: (E, N, 2 + m), for the observations last seen.
    """

    def __init__(self, adviser: Adviser, batch: Batch) -> None:
        self._adviser = adviser
        self._memory = begin(adviser, batch)
        worlds, trackers = batch.num_worlds, batch.scenario.num_trackers
        self.proposals = np.zeros(
            (worlds, trackers, MOTION + batch.scenario.message_size), np.float32
        )

    def follow(self, observations: FloatArray) -> None:
        """See the observations (E, N, F) that the last actions led to."""
        proposals, self._memory = self._adviser.act(observations, self._memory)
        self.proposals[...] = proposals

    def restart(self, observations: FloatArray, mask: BoolArray) -> None:
        """See the first observations of the episodes that begin in the worlds of a mask (E,)."""
        others = ~mask
        kept = {name: array[others] for name, array in self.arrays().items()}
        self._memory = self._adviser.restart(self._memory, mask)
        self.follow(observations)
        for name, array in self.arrays().items():
            array[others] = kept[name]

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Return what the adviser remembers, as arrays by name that share its memory."""
        return {**self._adviser.arrays(self._memory), "proposals": self.proposals}
