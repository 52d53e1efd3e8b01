"""Estimates with 95 % confidence intervals.

Intervals of means are bootstraps, seeded, so that tables are reproducible. What they resample is a *block* of worlds as
a whole: of a family ten worlds in a row, which play the same drawn scenario and so say little more of others than one
of them does; of a scenario each world alone. Blocks of a family are few, and percentiles of few values lie too near
(Hesterberg, What Teachers Should Know about the Bootstrap, 2015): their interval is Student's t times the bootstrap's
standard deviation. One block alone has no interval: both ends are its value.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt
import scipy  # its parts are imported when they are used: scipy.stats takes a second

RESAMPLES: Final = 2000
LEVEL: Final = 0.95

Values = npt.NDArray[np.float64]
Statistic = Callable[..., Any]


@dataclass(frozen=True)
class Estimate:
    """A value with its 95 % interval and the number of episodes that it is estimated from."""

    value: float
    low: float
    high: float
    count: int

    def __str__(self) -> str:
        if self.count == 0:
            return "-"
        return f"{self.value:.3f} [{self.low:.3f}, {self.high:.3f}]"


def mean(values: npt.ArrayLike, block: int = 1) -> Estimate:
    """Return the mean of the finite values of worlds in order; ``nan`` means "never happened"."""
    array = np.asarray(values, np.float64).reshape(-1)
    blocks = np.pad(array, (0, -len(array) % block), constant_values=np.nan).reshape(-1, block)
    known = np.isfinite(blocks)
    if not known.any():
        return Estimate(np.nan, np.nan, np.nan, 0)
    kept = np.where(known, blocks, np.nan)[known.any(axis=1)].reshape(1, -1)
    statistic = np.nanmean if np.isnan(kept).any() else np.mean  # the one takes several times as long as the other
    return replace(_resample((kept,), statistic, block), count=int(known.sum()))


def middle_mean(samples: Values, axis: int) -> Any:
    """Return the mean of the middle half."""
    return scipy.stats.trim_mean(samples, 0.25, axis)


def share(happened: npt.ArrayLike, block: int = 1) -> Estimate:
    """Return the share of episodes (S, W) in which something happened, with Wilson's interval for so many blocks.

    Of several seeds, or of a family, the ends of :func:`over_seeds` count where they are wider.
    """
    events = np.atleast_2d(np.asarray(happened, bool))
    p, n, z2 = events.mean(), -(-events.shape[1] // block), scipy.stats.norm.ppf((1 + LEVEL) / 2) ** 2
    half = np.sqrt(z2 * (p * (1 - p) / n + z2 / (2 * n) ** 2))
    low, high = ((p + z2 / (2 * n) + side) / (1 + z2 / n) for side in (-half, half))
    if len(events) > 1 or block > 1:
        wide = over_seeds(events, block=block)
        low, high = max(0.0, min(low, wide.low)), min(1.0, max(high, wide.high))
    return Estimate(float(p), float(low), float(high), events.size)


# --- several training seeds ----------------------------------------------------------------------


def over_seeds(values: npt.ArrayLike, statistic: Statistic = np.mean, block: int = 1) -> Estimate:
    """Return a statistic of the scores of S training seeds on the same W worlds, (S, W).

    The interval is for another training on other worlds: seeds and blocks of worlds are resampled, each as a
    whole; of one seed, its blocks. The sample variance of S seeds is (S - 1) / S of the true one on average, which is
    corrected for. As with any bootstrap of few values, the interval is still too narrow with few
    seeds: if seeds are the only source of variance, its coverage is about 75 % with 3 seeds, 86 %
    with 5 and 91 % with 10.

    Raises:
        ValueError: Not (S, W) numbers, at least one of each.
    """
    return _resample((_seeds_by_worlds(values),), statistic, block)


def difference(first: npt.ArrayLike, second: npt.ArrayLike, block: int = 1) -> Estimate:
    """Return the mean of first - second, paired by world.

    Each is one policy, (W,), or several training seeds, (S, W), on the same worlds. With one policy
    each the interval is a bootstrap over blocks of worlds, else as in :func:`over_seeds`.

    Raises:
        ValueError: Different numbers of worlds.
    """
    mine, theirs = _paired(first, second)
    if len(mine) == len(theirs) == 1:
        return mean(mine[0] - theirs[0], block)
    return _resample((mine, theirs), lambda a, b, axis: a.mean(axis) - b.mean(axis), block)


def improvement(first: npt.ArrayLike, second: npt.ArrayLike, block: int = 1) -> Estimate:
    """Return the probability that the first has the higher value in a world, ties counted half.

    Each is one policy, (W,), or several training seeds, (S, W), on the same worlds. All pairs of seeds are compared.
    Blocks of worlds are resampled, and the seeds of that side whose interval is wider.
    """
    mine, theirs = _paired(first, second)
    higher = (mine[:, None] > theirs) + 0.5 * (mine[:, None] == theirs)
    either = (over_seeds(higher.mean(axis=side), block=block) for side in (1, 0))
    return max(either, key=lambda found: found.high - found.low)


def _paired(first: npt.ArrayLike, second: npt.ArrayLike) -> tuple[Values, Values]:
    mine, theirs = _seeds_by_worlds(first), _seeds_by_worlds(second)
    if mine.shape[1] != theirs.shape[1]:
        raise ValueError(f"paired values need the same worlds, got {mine.shape} and {theirs.shape}")
    return mine, theirs


def _seeds_by_worlds(values: npt.ArrayLike) -> Values:
    array = np.atleast_2d(np.asarray(values, np.float64))
    if array.ndim != 2 or array.size == 0 or not np.isfinite(array).all():
        raise ValueError(f"scores must be finite numbers of shape (S, W), got {array.shape}")
    return array


def _resample(parts: Sequence[Values], statistic: Statistic, block: int) -> Estimate:
    """Return a statistic, of an axis, of parts (S, W): each has its own seeds, all have the same worlds."""
    worlds = parts[0].shape[1]
    blocks = -(-worlds // block)
    spread = []
    for part in parts:
        means, seeds = np.nanmean(part, axis=1, keepdims=True), len(part)
        wider = np.sqrt(seeds / (seeds - 1)) if seeds > 1 else 1.0
        spread.append(part + (wider - 1) * (means - means.mean()))
    rng = np.random.default_rng(0)
    n = 100 if worlds % block == 0 and sum(part.size for part in parts) < 50_000 else 1  # at once
    drawn = np.empty((RESAMPLES // n, n))
    for row in drawn:
        chosen = block * rng.integers(blocks, size=(n, blocks, 1)) + np.arange(block)
        chosen = chosen[chosen < worlds].reshape(n, 1, -1)  # the last block may be short
        whose = [rng.integers(len(part), size=(n, len(part), 1)) for part in spread]
        samples = (part[s, chosen].reshape(n, -1) for part, s in zip(spread, whose, strict=True))
        row[:] = statistic(*samples, axis=-1)
    found, tail = float(statistic(*(part.reshape(-1) for part in parts), axis=-1)), 50 * (1 - LEVEL)
    low, high = np.percentile(drawn, (tail, 100 - tail))
    if block > 1 and blocks > 1:  # few: their percentiles would lie too near
        half = scipy.stats.t.ppf((1 + LEVEL) / 2, blocks - 1) * np.sqrt(blocks / (blocks - 1)) * drawn.std()
        low, high = found - half, found + half
    if len(parts) == block == 1:  # no mean of values leaves their range, however the seeds are spread
        low, high = np.clip((low, high), np.nanmin(parts[0]), np.nanmax(parts[0]))
    return Estimate(found, float(low), float(high), parts[0].size)
