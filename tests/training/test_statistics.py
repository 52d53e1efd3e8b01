import numpy as np
import pytest
from scipy import stats

from posse_training.statistics import (
    interquartile_mean,
    mean,
    paired_difference,
    probability_of_improvement,
    share,
)


def test_the_interval_of_a_mean_agrees_with_the_normal_theory() -> None:
    values = np.random.default_rng(1).normal(3.0, 2.0, 1000)
    estimate = mean(values)
    half = 1.96 * values.std(ddof=1) / np.sqrt(len(values))
    assert estimate.value == pytest.approx(values.mean())
    assert estimate.low == pytest.approx(values.mean() - half, abs=0.02)
    assert estimate.high == pytest.approx(values.mean() + half, abs=0.02)


def test_intervals_cover_the_truth_as_often_as_they_say() -> None:
    rng = np.random.default_rng(2)
    covered = 0
    for _ in range(200):
        estimate = mean(rng.exponential(1.0, 80))
        covered += estimate.low <= 1.0 <= estimate.high
    assert 0.88 <= covered / 200 <= 0.99


def test_the_same_values_give_the_same_interval() -> None:
    values = np.random.default_rng(3).normal(size=50)
    assert mean(values) == mean(values)


def test_episodes_in_which_it_never_happened_do_not_count() -> None:
    estimate = mean([1.0, np.nan, 3.0])
    assert (estimate.value, estimate.count) == (2.0, 2)
    assert mean([np.nan, np.nan]).count == 0


def test_the_interquartile_mean_ignores_both_tails() -> None:
    values = np.concatenate([np.full(50, 0.5), np.full(10, 1e6), np.full(10, -1e6)])
    assert interquartile_mean(values).value == 0.5


def test_a_paired_difference_is_sharper_than_two_means() -> None:
    rng = np.random.default_rng(4)
    worlds = rng.normal(size=300)
    first = worlds + 0.1 + 0.01 * rng.normal(size=300)
    difference = paired_difference(first, worlds)
    assert difference.low > 0.09
    assert difference.high < 0.11
    with pytest.raises(ValueError, match="same episodes"):
        paired_difference(first, worlds[:-1])


def test_probability_of_improvement_counts_ties_half() -> None:
    assert probability_of_improvement([1, 2, 3, 4], [1, 1, 3, 5]).value == pytest.approx(0.5)


def test_a_share_has_wilsons_interval() -> None:
    estimate = share([True] * 990 + [False] * 10)
    z, n, p = stats.norm.ppf(0.975), 1000, 0.99
    centre = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    assert estimate.low == pytest.approx(centre - half)
    assert estimate.high == pytest.approx(centre + half)
    assert share([True] * 20).high == 1.0
