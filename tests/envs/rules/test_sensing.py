"""Sensing and radio beyond random worlds: outages, noise, relays, and the draws that all of it rests on."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.support.crowding import points

import posse
from posse.rules import randomness


def test_a_dead_sensor_sees_nothing_and_comes_back() -> None:
    batch = posse.batch("constant", 200, sensor_outages=0.5, outage_time=2.0, horizon=100)
    batch.reset(seed=2)
    from_step = batch.state["tracker_sensor_dead_from"].copy()
    for step in range(1, 100):
        batch.step(np.zeros(batch.action_shape))
        blind = batch.state["tracker_sees"] == 0
        np.testing.assert_array_equal(blind, (from_step <= step) & (step < from_step + 20))
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


def test_a_fix_goes_from_hop_to_hop_and_keeps_its_time() -> None:
    """A chain of four of which only the first sees the target; each hop takes delay plus a step."""
    batch = posse.batch(
        num_trackers=4, sensing_range=3.0, radio_range=4.5, radio_delay=2, target_speed=0.0, start_distance=(1.0, 16.0)
    )
    batch.reset(options={"target_pose": [0, 0, 0], "tracker_pose": [[2, 0, 0], [6, 0, 0], [10, 0, 0], [14, 0, 0]]})
    for step in range(1, 14):
        observations = batch.step(np.tile([-1.0, 0.0], (1, 4, 1)))[0]
        fixes = batch.state["tracker_fix_step"][0]
        # Said at step k, a fix is heard at k + 2, and passed on with the next broadcast, k + 3.
        assert fixes.tolist() == [max(-1, step - lag) if step >= lag else -1 for lag in (0, 2, 5, 8)]
        views = batch.layout.views(observations)
        known = fixes >= 0
        np.testing.assert_allclose(views["target_age"][0][known], 0.1 * (step - fixes[known]), rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(views["target_range"][0][known], 2 + 4 * np.flatnonzero(known))
        assert views["target_seen"][0].tolist() == [1, 0, 0, 0]


def test_the_mixing_function_is_splitmix64s() -> None:
    # The first outputs of SplitMix64 from seed 1234567, as published with it: mix(key, 0) is the
    # finalizer of key + golden ratio.
    golden, state, outputs = 0x9E3779B97F4A7C15, 1234567, []
    for _ in range(3):
        outputs.append(int(randomness.mix(np.uint64(state), np.uint64(0))))
        state = (state + golden) % 2**64
    assert outputs == [6457827717110365317, 3203168211198807973, 9817491932198370423]
