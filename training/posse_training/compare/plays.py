"""The results of a contender: one for each training seed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from posse import Family, Scenario
from posse_training.evaluation.results import Results


@dataclass(frozen=True)
class Plays:
    """The results of a contender in a number of worlds, one for each training seed."""

    label: str
    results: tuple[Results, ...]

    @property
    def scenario(self) -> Scenario | Family:
        """The scenario or family."""
        return self.results[0].scenario

    def __getitem__(self, metric: str) -> npt.NDArray[np.float64]:
        """Return a metric, (S, W): training seeds by worlds."""
        return np.stack([result[metric] for result in self.results])

    def paired(self, other: Plays) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Return the safe scores of both, (S, W) each, in the worlds that both played."""
        mine, theirs = self["safe_score"], other["safe_score"]
        both = min(mine.shape[1], theirs.shape[1])
        return mine[:, :both], theirs[:, :both]
