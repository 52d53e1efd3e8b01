"""Intervals around the numbers: every estimate is printed with how sure it is.

All from ``scipy.stats``; the bootstrap is seeded, so that a table is the same each time it is made.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from scipy import stats

RESAMPLES: Final = 2000
LEVEL: Final = 0.95

Values = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Estimate:
    """A number with its 95 % interval and the number of episodes behind it."""

    value: float
    low: float
    high: float
    count: int

    def __str__(self) -> str:
        if self.count == 0:
            return "-"
        return f"{self.value:.3f} [{self.low:.3f}, {self.high:.3f}]"

    def to_dict(self) -> dict[str, Any]:
        """Return the estimate as plain values."""
        return {"value": self.value, "low": self.low, "high": self.high, "count": self.count}


def _finite(values: npt.ArrayLike) -> Values:
    """Return the values that are numbers; ``nan`` stands for "never happened"."""
    array = np.asarray(values, np.float64).reshape(-1)
    return array[np.isfinite(array)]


def _bootstrap(values: Values, statistic: Any) -> Estimate:
    if len(values) == 0:
        return Estimate(np.nan, np.nan, np.nan, 0)
    value = float(statistic(values, axis=0))
    if len(values) == 1 or np.ptp(values) == 0:
        return Estimate(value, value, value, len(values))
    interval = stats.bootstrap(
        (values,),
        statistic,
        n_resamples=RESAMPLES,
        confidence_level=LEVEL,
        method="percentile",
        batch=100,
        rng=np.random.default_rng(0),
    ).confidence_interval
    return Estimate(value, float(interval.low), float(interval.high), len(values))


def mean(values: npt.ArrayLike) -> Estimate:
    """Return the mean of the values that are numbers, with a bootstrap interval."""
    return _bootstrap(_finite(values), np.mean)


def interquartile_mean(values: npt.ArrayLike) -> Estimate:
    """Return the mean of the middle half of the values, with a bootstrap interval."""

    def trimmed(sample: Values, axis: int = -1) -> Any:
        return stats.trim_mean(sample, 0.25, axis=axis)

    return _bootstrap(_finite(values), trimmed)


def paired_difference(first: npt.ArrayLike, second: npt.ArrayLike) -> Estimate:
    """Return the mean of first - second over the same worlds, with a bootstrap interval.

    Raises:
        ValueError: The two do not have as many episodes.
    """
    a, b = np.asarray(first, np.float64), np.asarray(second, np.float64)
    if a.shape != b.shape:
        raise ValueError(f"paired values need the same episodes, got {a.shape} and {b.shape}")
    return mean(a - b)


def probability_of_improvement(first: npt.ArrayLike, second: npt.ArrayLike) -> Estimate:
    """Return how often the first is better in a world, ties counted half, with an interval."""
    a, b = np.asarray(first, np.float64), np.asarray(second, np.float64)
    return mean((a > b) + 0.5 * (a == b))


def share(happened: npt.ArrayLike) -> Estimate:
    """Return the share of episodes in which something happened, with Wilson's interval."""
    events = np.asarray(happened, bool).reshape(-1)
    if len(events) == 0:
        return Estimate(np.nan, np.nan, np.nan, 0)
    interval = stats.binomtest(int(events.sum()), len(events)).proportion_ci(
        confidence_level=LEVEL, method="wilson"
    )
    return Estimate(float(events.mean()), float(interval.low), float(interval.high), len(events))
