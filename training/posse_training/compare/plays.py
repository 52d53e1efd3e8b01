"""The results of a contender: one for each training seed, and estimates over all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from posse import Scenario
from posse_training.evaluation.results import Results
from posse_training.evaluation.statistics import (
    Estimate,
    difference,
    improvement,
    interquartile_mean,
    mean,
    middle_mean,
    over_seeds,
    share,
)


@dataclass(frozen=True)
class Plays:
    """The results of a contender in a number of worlds, one for each training seed."""

    label: str
    results: tuple[Results, ...]

    @property
    def scenario(self) -> Scenario:
        """The scenario."""
        return self.results[0].scenario

    def __getitem__(self, metric: str) -> npt.NDArray[np.float64]:
        """Return a metric, (S, W): training seeds by worlds."""
        return np.stack([result[metric] for result in self.results])

    def mean(self, metric: str) -> Estimate:
        """Return the mean of a metric that every episode has; seeds and worlds are resampled."""
        values = self[metric]
        return mean(values[0]) if len(values) == 1 else over_seeds(values)

    def interquartile_mean(self, metric: str) -> Estimate:
        """Return the mean of the middle half of all episodes."""
        values = self[metric]
        return interquartile_mean(values[0]) if len(values) == 1 else over_seeds(values, middle_mean)

    def share(self, happened: Sequence[npt.NDArray[np.bool_]]) -> Estimate:
        """Return the share of episodes in which something happened; (W,) for each seed."""
        return share(happened[0]) if len(happened) == 1 else over_seeds(np.stack(happened))

    def difference(self, reference: Plays) -> Estimate:
        """Return the mean difference of the safe score to the reference, paired by world."""
        return difference(*self._paired(reference))

    def improvement(self, reference: Plays) -> Estimate:
        """Return the probability of a higher safe score than the reference's in a world."""
        return improvement(*self._paired(reference))

    def ratio(self, reference: Plays) -> float:
        """Return the mean safe score as a share of the reference's, in the worlds of both."""
        mine, theirs = self._paired(reference)
        return float(mine.mean() / theirs.mean()) if theirs.any() else float("nan")

    def _paired(self, other: Plays) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Return the safe scores of both, (S, W) each, in the worlds that both played."""
        mine, theirs = self["safe_score"], other["safe_score"]
        both = min(mine.shape[1], theirs.shape[1])
        return mine[:, :both], theirs[:, :both]
