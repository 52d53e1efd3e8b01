"""Read access to a batch: the state of its worlds, and metrics of the current episodes."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from posse.numeric import BoolArray, FloatArray, Records
from posse.rules.state import WorldArrays
from posse.scenarios import Scenario
from posse.signals.generate import Declarations
from posse.signals.metrics import episode_metrics


class WorldViews:
    """Views of the arrays of a batch."""

    scenario: Scenario
    _arrays: WorldArrays
    _score: FloatArray
    _declared: Declarations

    @property
    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Every state array by name, as read-only views that follow the worlds.

        Names are ``<array>_<field>``, e.g. ``"tracker_x"`` (E, N) or ``"world_step"`` (E,);
        :mod:`posse.rules.state` documents every field.
        """
        names = self._arrays.by_name()
        for view in names.values():
            view.flags.writeable = False
        return names

    @property
    def worlds(self) -> Records:
        """The worlds' records, (E,) :func:`posse.rules.state.world_record`."""
        return self._arrays.world

    @property
    def score(self) -> FloatArray:
        """(E,) the score of the current step; 0 at the start."""
        return self._score.copy()

    @property
    def terminated(self) -> BoolArray:
        """(E,) whether the last step or reset left the world's episode terminated."""
        return np.asarray(self._arrays.world["terminated"] != 0)

    @property
    def truncated(self) -> BoolArray:
        """(E,) whether the last step or reset left the world's episode truncated."""
        return np.asarray(self._arrays.world["over"] != 0) & ~self.terminated

    @property
    def arrays(self) -> WorldArrays:
        """The arrays themselves, not copies: writing to them changes the worlds."""
        return self._arrays

    @property
    def bytes_per_world(self) -> int:
        """Size of the state of one world, bytes."""
        return self._arrays.bytes_per_world

    def metrics(self) -> dict[str, npt.NDArray[np.float64]]:
        """Return the metrics of the current episodes by name, (E,) each."""
        return episode_metrics(self._declared.metrics, self.scenario, self._arrays.world)
