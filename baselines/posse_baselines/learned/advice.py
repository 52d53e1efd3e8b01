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
from posse.numeric import BoolArray, FloatArray
from posse_baselines.ddcs import DDCS
from posse_baselines.ddcs.belief import BELIEF_SIZE
from posse_baselines.policy import Policy, PolicyError
from posse_baselines.safeguard import Guard

REACH: Final = np.float32(2.0)
"""Factor of the network's output: spans the whole of [-1, 1] from either end."""
MOTION: Final = 2
"""Numbers of an action that move the tracker; a proposal adds as many inputs."""


def check_adviser(policy: Policy | None, *, believes: bool) -> int:
    """Return how many numbers a network reads in addition to its encoding, with an adviser or without.

    PolicyError if the adviser is none of the DDCS, or there is none whose belief could be read.
    """
    if policy is None and believes:
        raise PolicyError("a policy that reads an adviser's belief needs an adviser")
    if policy is not None and not isinstance(policy, DDCS):
        raise PolicyError(f"{policy.name!r} cannot be an adviser: use a policy of the DDCS, such as ddcs-tuned")
    return 0 if policy is None else MOTION + (BELIEF_SIZE if believes else 0)


class Advice(Guard):
    """The safeguard of an adviser, which carries out its own velocities as a network corrects them.

    Args:
        adviser: A policy of the DDCS.
        layout: Of the observations.
        num_worlds: E; their episodes may begin apart.
        believes: Whether the network reads the adviser's belief.
    """

    def __init__(self, adviser: Any, layout: ObservationLayout, num_worlds: int, *, believes: bool = False) -> None:
        size = check_adviser(adviser, believes=believes)
        super().__init__(layout, num_worlds, minds=adviser.begin(layout, num_worlds))
        self.inputs = np.zeros((*self.minds.me.shape, size), np.float32)
        self._adviser, self._believes = adviser, believes

    def follow(self, observations: FloatArray, mask: BoolArray | None = None) -> None:
        """Ask for advice on the observations (E, N, F) of a control step, in the worlds of a mask (E,) or in all."""
        kept = {} if mask is None else {name: array[~mask] for name, array in self.arrays().items()}
        super().follow(observations)
        self.inputs[...], _ = self._adviser.propose(observations, self.minds, believes=self._believes)
        for name, array in self.arrays().items():
            if mask is not None:
                array[~mask] = kept[name]

    def actions(self, wanted: npt.ArrayLike) -> FloatArray:
        """Return the actions (E, N, 2 + m) for the network's outputs (E, N, 2), corrections of what is wanted."""
        outputs = np.asarray(wanted)[..., :MOTION]
        actions, _ = self._adviser.carry_out(self._observed, self.minds, REACH * outputs)
        return np.asarray(actions)
