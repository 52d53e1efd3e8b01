"""Targets that read nothing: they drive by the clock, whatever the team does.

A target that learns must cost a team more than the most harmful of these, else a team loses to a motion that needs no
policy.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from posse import ObservationLayout
from posse.numeric import BoolArray, FloatArray

Shares = tuple[npt.ArrayLike, npt.ArrayLike]
"""Speed, in [0, 1], and turn rate, in [-1, 1], of a target as shares of its greatest."""


class Clock(NamedTuple):
    """Memory: the control step in s, and the times (E,) in s since the start of each episode."""

    step: float
    times: FloatArray


@dataclass(frozen=True)
class OpenLoop:
    """A target's policy that is a function of time.

    Attributes:
        name: Its name.
        motion: Times (E,) in s since the start of each episode → shares, (E,) each or the same for all.
    """

    name: str
    motion: Callable[[FloatArray], Shares]

    def begin(self, layout: ObservationLayout, num_worlds: int) -> Clock:
        """Return the clock at the start."""
        return Clock(layout.scenario.control_step, np.zeros(num_worlds, np.float32))

    def act(self, observations: FloatArray, memory: Clock) -> tuple[FloatArray, Clock]:
        """Return the actions (E, 1, 2) at the times of the clock."""
        actions = np.empty((len(observations), 1, 2), np.float32)
        speed, turn = self.motion(memory.times)
        actions[:, 0, 0], actions[:, 0, 1] = 2.0 * np.asarray(speed) - 1.0, turn
        return actions, memory._replace(times=memory.times + np.float32(memory.step))

    def restart(self, memory: Clock, mask: BoolArray) -> Clock:
        """Return the clock at the start in the worlds of a mask (E,)."""
        return memory._replace(times=np.where(mask, np.float32(0.0), memory.times))

    def arrays(self, memory: Clock) -> dict[str, npt.NDArray[Any]]:
        """Return the memory as arrays (E, ...) by name; views, not copies."""
        return {"times": memory.times}


def _circle(turn: float, _: FloatArray) -> Shares:
    return 1.0, turn


def _stop_and_go(times: FloatArray) -> Shares:
    return (times // 1.5) % 2.0, 0.0


def _spiral(times: FloatArray) -> Shares:
    return 1.0, 1.0 - times % 30.0 / 30.0


def _eight(times: FloatArray) -> Shares:
    return 1.0, np.where((times // 6.0) % 2.0 > 0.0, 1.0, -1.0)


OPEN_LOOP: Final = {
    target.name: target
    for target in (
        OpenLoop("left-circle", partial(_circle, 1.0)),
        OpenLoop("right-circle", partial(_circle, -1.0)),
        OpenLoop("wide-circle", partial(_circle, 0.5)),
        OpenLoop("stop-and-go", _stop_and_go),
        OpenLoop("spiral", _spiral),
        OpenLoop("eight", _eight),
    )
}
"""By name. The scenario's motion ``constant`` is the one that drives straight ahead."""
