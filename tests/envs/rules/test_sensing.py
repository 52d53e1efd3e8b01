"""Sensing and radio beyond random worlds: outages, noise, relays, and the draws that all of it rests on."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.support.reference.state import points

import posse


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
