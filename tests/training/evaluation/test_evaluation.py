"""Evaluations of a policy on many worlds, and the intervals of their means."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from posse_baselines.policies.simple import Idle
from posse_training import evaluate
from posse_training.errors import SettingsError
from posse_training.evaluation.statistics import difference, improvement, mean, over_seeds, share

FAST: dict[str, Any] = {"progress": False, "horizon": 60}


def test_scores_are_of_whole_episodes() -> None:
    settings: dict[str, Any] = {"progress": False, "start_distance": (0.6, 2.0)}
    plain, ending = (evaluate("random", "smart", 20, terminate_on_contact=ends, **settings) for ends in (False, True))
    assert plain["contact_free"].min() == 0.0
    np.testing.assert_array_equal(plain["safe_score"], ending["safe_score"])


def test_a_policy_that_does_not_say_so_is_not_given_the_state(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Idle, "watch", lambda *_: pytest.fail("it is given"), raising=False)
    evaluate("idle", "constant", 1, **FAST)


def test_worlds_of_a_drawn_scenario_are_resampled_as_one() -> None:
    rng = np.random.default_rng(4)
    means, other = rng.normal(size=12), rng.normal(size=113)
    values = np.repeat(means, 10)[:113]  # the last block is short
    wanted = stats.t.interval(0.95, 11, means.mean(), stats.sem(means))
    for found in (mean(values, 10), over_seeds(values, block=10), difference(values + other, other, 10)):
        assert (found.low, found.high) == pytest.approx(wanted, abs=0.15)
    assert difference([values, values], values + 1, 10).high == pytest.approx(-1)
    assert over_seeds(other, block=10).low == pytest.approx(mean(other, 10).low), "a short block weighs less"
    few = mean(values[:30], 10)  # three blocks
    assert (few.low, few.high) == pytest.approx(stats.t.interval(0.95, 2, means[:3].mean(), stats.sem(means[:3])), 0.1)


def test_the_interval_of_a_share_of_all_has_a_width(tmp_path: Path) -> None:
    (results := evaluate("idle", "constant", 10, start_distance=(9.0, 10.0), **FAST)).write(str(tmp_path / "all.csv"))
    assert results.estimate("contact_free").low == pytest.approx(10 / (10 + 1.96**2), abs=1e-3)  # Wilson's, of 10 in 10
    assert "idle on constant: safe score 0.000 [0.000, 0.000], 10 episodes" in repr(results)
    for several in (share(np.ones((3, 40))), share(np.ones((1, 400)), block=10)):
        assert (several.low, several.high) == pytest.approx((40 / (40 + 1.96**2), 1), abs=1e-3)
    assert share(np.arange(40) < 10, block=10).low >= 0
    with pytest.raises(KeyError, match="unknown metric 'scor'; metrics are: score"):
        results["scor"]
    with pytest.raises(SettingsError, match=r"must end in \.csv"):
        results.write(tmp_path / "all.json")


def test_episodes_in_which_it_never_happened_do_not_count() -> None:
    for block in (1, 2):
        estimate = mean([1.0, np.nan, np.nan, np.nan, 3.0], block)
        assert (estimate.value, estimate.count) == (2.0, 2)
    assert mean([np.nan, np.nan]).count == 0


class TestTrainingSeeds:
    def test_the_interval_is_as_wide_as_the_analysis_of_variance_says(self) -> None:
        seeds, worlds = 12, 150
        rng = np.random.default_rng(5)  # of effects of the seed, of the world, and of both together
        values = 0.3 * rng.normal(size=(seeds, 1)) + rng.normal(size=worlds) + 0.1 * rng.normal(size=(seeds, worlds))
        # Two crossed random effects: the mean squares of rows, columns and rest (Searle).
        rows, columns = values.mean(axis=1), values.mean(axis=0)
        rest = values - rows[:, None] - columns[None] + values.mean()
        of_rest = (rest**2).sum() / ((seeds - 1) * (worlds - 1))
        of_seeds, of_worlds = worlds * rows.var(ddof=1), seeds * columns.var(ddof=1)
        deviation = np.sqrt((of_seeds + of_worlds - of_rest) / (seeds * worlds))
        estimate = over_seeds(values)
        assert estimate.value == pytest.approx(values.mean())
        ends = values.mean() + np.array([-1.96, 1.96]) * deviation
        assert [estimate.low, estimate.high] == pytest.approx(ends, abs=0.19 * deviation)

    def test_what_worlds_have_in_common_leaves_a_paired_difference(self) -> None:
        rng = np.random.default_rng(7)
        worlds = 10 * rng.normal(size=200)
        trained = worlds + 0.5 + 0.05 * rng.normal(size=(5, 200))
        paired = difference(trained, worlds)
        assert paired.value == pytest.approx(0.5, abs=0.02)
        assert paired.high - paired.low < 0.1
        assert over_seeds(trained).high - over_seeds(trained).low > 1
        assert over_seeds([[1] * 20, [1] * 20, [0] * 10 + [1] * 10]).high == 1
        turned = difference(worlds, trained)
        assert turned.value == pytest.approx(-paired.value)
        assert turned.low == pytest.approx(-paired.high, abs=0.02)

    def test_improvement_compares_every_pair_of_seeds(self) -> None:
        mine, theirs = np.array([[1.0, 4.0], [2.0, 4.0]]), np.array([[0.0, 4.0], [2.0, 5.0]])
        assert improvement(mine, theirs).value == pytest.approx((1 + 0 + 1 + 0.5 + 4 * 0.25) / 8)
        trained, script = np.random.default_rng(3).normal(size=(3, 1)) + np.zeros(50), np.zeros(50)
        better, worse = improvement(trained, script), improvement(script, trained)
        assert (worse.low, worse.high) == pytest.approx((1 - better.high, 1 - better.low))

    def test_worlds_that_do_not_match_are_refused(self) -> None:
        with pytest.raises(ValueError, match="same worlds"):
            difference(np.zeros((3, 5)), np.zeros(4))
        with pytest.raises(ValueError, match="same worlds"):
            improvement([1, 2], [1, 2, 3])
        with pytest.raises(ValueError, match="numbers"):
            over_seeds([[np.nan, 1.0]])
        with pytest.raises(ValueError, match="numbers"):
            over_seeds([])
