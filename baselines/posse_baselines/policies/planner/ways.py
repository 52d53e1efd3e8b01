"""Ways for a tracker to play the law: what the planner chooses between."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse.numeric import Records
from posse_baselines.policies.planner.settings import PlannerSettings

WAY: Final[np.dtype[Any]] = np.dtype(
    (
        np.record,
        np.dtype(
            [
                ("ahead", np.float64),  # shift of the slot along the target's heading, m
                ("left", np.float64),  # shift of the slot to its left, m
                ("gain", np.float64),  # of the slot law, 1/s
                ("foresees", np.float64),  # 1: the target is met on the path that it was foreseen
            ],
            align=True,
        ),
    )
)
"""How one tracker plays."""

_STANDARD: Final = (
    # ahead, left, gain, foresees
    (0.0, 0.0, 1.5, 0.0),
    (-0.2, 0.0, 1.5, 0.0),
    (0.2, 0.0, 1.5, 0.0),
    (0.0, 0.0, 0.7, 0.0),
    (0.0, 0.0, 3.0, 0.0),
    (0.0, 0.0, 1.5, 1.0),
    (0.0, 0.0, 3.0, 1.0),
)
_RANGES: Final = {"ahead": (-0.25, 0.25), "left": (-0.2, 0.2), "gain": (0.7, 4.0)}
TRIES: Final = len(_STANDARD) + 1
"""Tries in each round: the standard ways and what was kept; or the best so far, and variations."""
_REPEAT: Final = 64  # plannings after which the variations repeat


def standard_ways(num_trackers: int) -> Records:
    """Return the ways that whole teams play alike, (TRIES - 1, N) :data:`WAY`."""
    ways = np.array(list(_STANDARD), WAY)
    return np.repeat(ways[:, None], num_trackers, axis=1)


class Variations:
    """Changes to try on the ways of a team, the same for all worlds at the same planning.

    They are drawn once, so that what is tried in a world does not depend on the others.
    """

    def __init__(self, settings: PlannerSettings, num_trackers: int) -> None:
        rng = np.random.default_rng(settings.seed)
        shape = (_REPEAT, settings.rounds, TRIES - 1, num_trackers)
        self._changed = rng.random(shape) < settings.varied
        self._shifts = {
            name: settings.spread * (high - low) * rng.normal(size=shape) for name, (low, high) in _RANGES.items()
        }
        self._foresees = rng.random(shape) < 0.5

    def of(self, best: Records, planning: npt.NDArray[np.int64], turn: int) -> Records:
        """Return the best ways (E, N) and variations on them, (E, TRIES, N).

        Args:
            best: (E, N) :data:`WAY`.
            planning: (E,) number of the planning in each world's episode.
            turn: Which round of it.
        """
        tries = np.repeat(best[:, None], TRIES, axis=1)
        drawn = planning % _REPEAT, turn
        varied, changed = tries[:, 1:], self._changed[drawn]
        for name, (low, high) in _RANGES.items():
            new = np.clip(varied[name] + self._shifts[name][drawn], low, high)
            varied[name] = np.where(changed, new, varied[name])
        varied["foresees"] = np.where(changed, self._foresees[drawn], varied["foresees"])
        return tries
