"""Targets that read nothing: they drive by the clock, whatever the team does.

A target that learns must cost a team more than the most harmful of these, else a team loses to a motion that needs no
policy.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse import ObservationLayout
from posse.numeric import BoolArray, FloatArray

Clock = tuple[float, FloatArray]
"""Memory: the control step in s, and the times (E,) in s since the start of each episode."""
_MOTIONS: Final[dict[str, Callable[[FloatArray], tuple[npt.ArrayLike, npt.ArrayLike]]]] = {
    "standing": lambda times: (0.0, 0.0),
    "slow": lambda times: (0.5, 0.0),
    "left-circle": lambda times: (1.0, 1.0),
    "right-circle": lambda times: (1.0, -1.0),
    "wide-circle": lambda times: (1.0, 0.5),
    "stop-and-go": lambda times: ((times // 1.5) % 2.0, 0.0),
    "spiral": lambda times: (1.0, 1.0 - times % 30.0 / 30.0),
    "eight": lambda times: (1.0, np.where((times // 6.0) % 2.0 > 0.0, 1.0, -1.0)),
}
"""By name: times of the clock → speed, in [0, 1], and turn rate, in [-1, 1], of a target as shares of its greatest."""


@dataclass(frozen=True)
class OpenLoop:
    """A target's policy that is a function of time: one of :data:`OPEN_LOOP`."""

    name: str

    def begin(self, layout: ObservationLayout, num_worlds: int) -> Clock:
        """Return the clock at the start."""
        return layout.scenario.control_step, np.zeros(num_worlds, np.float32)

    def act(self, observations: FloatArray, memory: Clock) -> tuple[FloatArray, Clock]:
        """Return the actions (E, 1, 2) at the times of the clock."""
        step, times = memory
        actions = np.empty((len(observations), 1, 2), np.float32)
        speed, turn = _MOTIONS[self.name](times)
        actions[:, 0, 0], actions[:, 0, 1] = 2.0 * np.asarray(speed) - 1.0, turn
        return actions, (step, times + np.float32(step))

    def restart(self, memory: Clock, mask: BoolArray) -> Clock:
        """Return the clock at the start in the worlds of a mask (E,)."""
        step, times = memory
        return step, np.where(mask, np.float32(0.0), times)

    def arrays(self, memory: Clock) -> dict[str, npt.NDArray[Any]]:
        """Return the memory as arrays (E, ...) by name; views, not copies."""
        return {"times": memory[1]}


OPEN_LOOP: Final = {name: OpenLoop(name) for name in _MOTIONS}
"""By name. The scenario's motion ``constant`` is the one that drives straight ahead."""
