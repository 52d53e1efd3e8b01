"""What is drawn beside the start: noise of measurements, outages of sensors, who breaks and when."""

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


def test_outages_begin_at_uniform_times() -> None:
    batch = posse.batch("constant", 200, sensor_outages=0.5, horizon=100)
    batch.reset(seed=2)
    from_step = batch.state["tracker_sensor_dead_from"]
    failing = from_step < 100
    assert abs(failing.mean() - 0.5) < 4 * 0.5 / math.sqrt(failing.size)
    begins = from_step[failing] / 100
    assert abs(begins.mean() - 0.5) < 4 * 0.289 / math.sqrt(len(begins)), "uniform"


def test_noise_is_unbiased_has_its_deviation_and_is_cut_at_three() -> None:
    range_noise, bearing_noise = 0.05, 0.1
    batch = posse.batch(num_worlds=400, range_noise=range_noise, bearing_noise=bearing_noise)
    batch.reset(seed=4)
    relative = []  # measured over true vectors to the target
    for _ in range(10):
        batch.step(np.zeros(batch.action_shape))
        own, fix = points(batch, "tracker"), points(batch, "tracker_fix")
        relative.append((fix - own) / (points(batch, "world")[:, None] - own))
    measured, cut = np.array(relative), math.exp(-4.5)
    deviation = math.sqrt(1 - 4.5 * cut / (1 - cut))
    for errors, scale in ((np.abs(measured) - 1, range_noise), (np.angle(measured), bearing_noise)):
        count = errors.size
        assert abs(errors.mean()) < 4 * scale / math.sqrt(count)
        assert errors.std() == pytest.approx(scale * deviation, rel=4 / math.sqrt(2 * count))
        assert 2.5 * scale < np.abs(errors).max() <= 3 * scale + 1e-4
        # Neither successive steps nor neighbouring trackers share a draw.
        assert abs(np.corrcoef(errors[1:].ravel(), errors[:-1].ravel())[0, 1]) < 0.03
        assert abs(np.corrcoef(errors[..., 1:].ravel(), errors[..., :-1].ravel())[0, 1]) < 0.03
