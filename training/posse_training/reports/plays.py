"""The results of a contender: one for each training seed, and estimates over all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from posse import Scenario
from posse_training.reports.results import Results
from posse_training.reports.statistics import (
    Estimate,
    difference_over_seeds,
    interquartile_mean,
    mean,
    middle_mean,
    over_seeds,
    paired_difference,
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
        return (
            interquartile_mean(values[0]) if len(values) == 1 else over_seeds(values, middle_mean)
        )

    def share(self, happened: Sequence[npt.NDArray[np.bool_]]) -> Estimate:
        """Return the share of episodes in which something happened; (W,) for each seed."""
        return share(happened[0]) if len(happened) == 1 else over_seeds(np.stack(happened))

    def difference(self, reference: Plays) -> Estimate:
        """Return the mean difference of the score to the reference, paired by world."""
        mine, theirs = self["score"], reference["score"]
        if len(mine) == len(theirs) == 1:
            return paired_difference(mine[0], theirs[0])
        return difference_over_seeds(mine, theirs)

    def improvement(self, reference: Plays) -> Estimate:
        """Return the probability of improvement on the reference in a world, ties counted half."""
        mine, theirs = self["score"][:, None], reference["score"][None]
        better = ((mine > theirs) + 0.5 * (mine == theirs)).mean(axis=1)
        return mean(better[0]) if len(better) == 1 else over_seeds(better)
