"""Faults: who breaks and when, and what a broken tracker still does."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.support.reference.state import NEVER, points

import posse


def broken(batch: posse.Batch) -> np.ndarray:
    return np.asarray(batch.state["tracker_broken_at"] != NEVER)


@pytest.mark.parametrize("number", [1, 4])
def test_drawn_trackers_break_at_drawn_times(number: int) -> None:
    batch = posse.batch(
        num_worlds=300, breaks=number, break_choice="drawn", break_window=(0.3, 0.7), horizon=100, autoreset="disabled"
    )
    batch.reset(seed=1)
    for _ in range(100):
        batch.step(np.zeros(batch.action_shape))
        assert (batch.state["world_working"] == 5 - broken(batch).sum(axis=1)).all()
    at = batch.state["tracker_broken_at"]
    assert (broken(batch).sum(axis=1) == number).all()
    times = at[at != NEVER]
    assert times.min() >= 30
    assert times.max() < 70
    assert abs(times.mean() - 49.5) < 4 * 40 / math.sqrt(12 * len(times))
    each = (at != NEVER).mean(axis=0)
    assert np.abs(each - number / 5).max() < 4 * math.sqrt(0.25 / 300), "no number is spared"


def test_the_nearest_to_the_target_break_one_after_the_other_within_the_window() -> None:
    batch = posse.batch("leader-loss", 100, breaks=3, break_window=(0.2, 0.6), autoreset="disabled", horizon=100)
    batch.reset(seed=3)
    rng = np.random.default_rng(2)
    for _ in range(100):
        away, was_broken = np.abs(points(batch, "tracker") - points(batch, "world")[:, None]), broken(batch)
        batch.step(rng.uniform(-1, 1, batch.action_shape))
        for e in np.flatnonzero((broken(batch) & ~was_broken).any(axis=1)):
            new = np.flatnonzero(broken(batch)[e] & ~was_broken[e])
            assert new.tolist() == [np.where(was_broken[e], np.inf, away[e]).argmin()]
    times = np.sort(batch.state["tracker_broken_at"], axis=1)
    assert (times[:, 3:] == NEVER).all()
    assert (times[:, 0] >= 20).all()
    assert (np.diff(times[:, :3], axis=1) >= 1).all(), "one at a time"
    assert (times[:, 2] <= 62).all(), "the window is not left, but for a step each"
    assert np.ptp(times[:, 0]) > 25, "the first is drawn from all of the window"
