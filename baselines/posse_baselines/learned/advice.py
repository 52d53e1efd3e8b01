"""A scripted adviser beside a learned policy (residual policy learning).

At each step the adviser, a team of the DDCS, proposes the velocity that it wants, the network reads the proposal
together with the observation, and twice its output is added to the proposal, before the adviser's safeguard against
contact. An output of zero reproduces the adviser, and every velocity stays reachable. The adviser's messages are sent
unchanged, and its memory is its own, so the network needs no memory. An encoding that ``believes`` also reads what the
adviser believes. References: Silver et al. 2018, Johannink et al. 2019; Alshiekh et al. 2018 (safeguard).
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse import ObservationLayout
from posse.numeric import BoolArray, FloatArray, OwnArrays
from posse_baselines.ddcs import DDCS
from posse_baselines.learned.belief import BELIEF_SIZE, beliefs_of
from posse_baselines.policy import Policy, PolicyError

REACH: Final = np.float32(2.0)
"""Factor of the network's output: spans the whole of [-1, 1] from either end."""
MOTION: Final = 2
"""Numbers of an action that move the tracker; a proposal adds as many inputs."""


def check_adviser(policy: Policy | None, *, believes: bool) -> int:
    """Return how many numbers a network reads in addition to its encoding, with an adviser or without.

    Raises:
        PolicyError: The policy is none of the DDCS, or there is none whose belief could be read.
    """
    if policy is None and believes:
        raise PolicyError("a policy that reads an adviser's belief needs an adviser")
    if policy is not None and not isinstance(policy, DDCS):
        raise PolicyError(f"{policy.name!r} cannot be an adviser: use a policy of the DDCS, such as ddcs-tuned")
    return 0 if policy is None else MOTION + (BELIEF_SIZE if believes else 0)


class Advice(OwnArrays):
    """The adviser's memory and its answers to the latest observations, in E worlds whose episodes may begin apart.

    Args:
        adviser: A policy of the DDCS.
        layout: Of the observations.
        num_worlds: E.
        believes: Whether the network reads the adviser's belief.

    Attributes:
        inputs: (E, N, k), what the network reads in addition to its encoding.
        memory: Of the adviser.

    Raises:
        PolicyError: Another policy.
    """

    def __init__(self, adviser: Any, layout: ObservationLayout, num_worlds: int, *, believes: bool = False) -> None:
        team = num_worlds, layout.scenario.num_trackers
        self.inputs = np.zeros((*team, check_adviser(adviser, believes=believes)), np.float32)
        self.memory = adviser.begin(layout, num_worlds)
        self._adviser, self._believes = adviser, believes
        self._asked = np.zeros((*team, layout.size), np.float32)

    def follow(self, observations: FloatArray, mask: BoolArray | None = None) -> None:
        """Ask for advice on the observations (E, N, F) of a control step, in the worlds of a mask (E,) or in all."""
        kept = {} if mask is None else {name: array[~mask] for name, array in self.arrays().items()}
        self._asked[...] = observations
        self.inputs[..., :MOTION], self.memory = self._adviser.propose(self._asked, self.memory)
        if self._believes:
            self.inputs[..., MOTION:] = beliefs_of(self.memory, self._asked)
        for name, array in self.arrays().items():
            if mask is not None:
                array[~mask] = kept[name]

    def actions(self, outputs: FloatArray) -> FloatArray:
        """Return the actions (E, N, 2 + m) for the network's outputs (E, N, 2)."""
        actions, self.memory = self._adviser.carry_out(self._asked, self.memory, REACH * outputs[..., :MOTION])
        return np.asarray(actions)

    def restart(self, mask: BoolArray) -> None:
        """Have the adviser begin anew in the worlds of a mask (E,)."""
        self.memory = self._adviser.restart(self.memory, mask)

    def arrays(self) -> dict[str, npt.NDArray[Any]]:
        """Return the memory and the answers as arrays by name; views, not copies."""
        return {**self._adviser.arrays(self.memory), "inputs": self.inputs, "asked": self._asked}
