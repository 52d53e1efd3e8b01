"""A scripted adviser beside a learned policy (residual policy learning).

At each step the adviser, a team of the DDCS, proposes the velocity that it wants, the network reads the proposal
together with the observation, and twice its output is added to the proposal, before the adviser's safeguard against
contact. An output of zero reproduces the adviser, and every velocity stays reachable. The adviser's messages are sent
unchanged, and its memory is its own, so the network needs no memory. With ``believes`` the network also reads what the
adviser believes. References: Silver et al. 2018, Johannink et al. 2019; Alshiekh et al. 2018 (safeguard).
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse import Batch
from posse.numeric import BoolArray, FloatArray
from posse_baselines.ddcs import DDCS
from posse_baselines.ddcs.belief import BELIEF_SIZE
from posse_baselines.policy import Memory, Policy, PolicyError, begin

REACH: Final = np.float32(2.0)
"""Factor of the network's output: spans the whole of [-1, 1] from either end."""
MOTION: Final = 2
"""Numbers of an action that move the tracker; a proposal adds as many inputs."""


class Advising:
    """How a network and its adviser make actions together; without any memory of its own.

    Args:
        adviser: The policy that proposes, one of the DDCS.
        believes: Whether the network reads the adviser's belief.

    Attributes:
        inputs: How many numbers the network reads in addition to its encoding.

    Raises:
        PolicyError: Another policy.
    """

    def __init__(self, adviser: Policy, *, believes: bool = False) -> None:
        if not isinstance(adviser, DDCS):
            raise PolicyError(f"{adviser.name!r} cannot be an adviser: use a policy of the DDCS, such as ddcs-tuned")
        self.adviser = adviser
        self.inputs = MOTION + (BELIEF_SIZE if believes else 0)
        self._believes = believes

    def ask(self, observations: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return the network's further inputs (E, N, k) and the adviser's memory."""
        return self.adviser.propose(observations, memory, believes=self._believes)

    def answer(self, observations: FloatArray, outputs: FloatArray, memory: Memory) -> tuple[FloatArray, Memory]:
        """Return actions (E, N, 2 + m) for the observations asked about and the network's outputs (E, N, 2)."""
        return self.adviser.carry_out(observations, memory, REACH * outputs)


class Advice:
    """The adviser's memory and its answers to the latest observations, in the worlds of one batch.

    Args:
        advising: How actions are made.
        batch: The worlds; their episodes may begin at different times.

    Attributes:
        inputs: (E, N, k), what the network reads in addition to its encoding.
    """

    def __init__(self, advising: Advising, batch: Batch) -> None:
        self._advising = advising
        self._memory = begin(advising.adviser, batch)
        worlds, trackers = batch.num_worlds, batch.scenario.num_trackers
        self.inputs = np.zeros((worlds, trackers, advising.inputs), np.float32)
        self._asked = np.zeros((worlds, trackers, batch.layout.size), np.float32)

    def follow(self, observations: FloatArray) -> None:
        """Ask for advice on the observations (E, N, F) after a step."""
        self._asked[...] = observations
        self.inputs[...], self._memory = self._advising.ask(observations, self._memory)

    def actions(self, outputs: FloatArray) -> FloatArray:
        """Return the actions (E, N, 2 + m) for the network's outputs (E, N, 2)."""
        actions, self._memory = self._advising.answer(self._asked, outputs, self._memory)
        return actions

    def restart(self, observations: FloatArray, mask: BoolArray) -> None:
        """Ask for advice on the first observations of the worlds in a mask (E,)."""
        others = ~mask
        kept = {name: array[others] for name, array in self.arrays().items()}
        self._memory = self._advising.adviser.restart(self._memory, mask)
        self.follow(observations)
        for name, array in self.arrays().items():
            array[others] = kept[name]

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Return the memory and the answers as arrays by name; views, not copies."""
        memory = self._advising.adviser.arrays(self._memory)
        return {**memory, "inputs": self.inputs, "asked": self._asked}
