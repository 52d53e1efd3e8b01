"""Sensing: sight, its limits and noise, and the sonar."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from tests.support.reference.senses import can_see, sonar
from tests.support.reference.state import one_world, snapshot

import posse


def offsets(batch: posse.Batch) -> tuple[np.ndarray, np.ndarray]:
    """Return true and measured places of the target, seen from each tracker, complex (E, N)."""
    state = batch.state
    x, y = state["tracker_x"].astype(np.float64), state["tracker_y"].astype(np.float64)
    true = state["world_x"][:, None] - x + 1j * (state["world_y"][:, None] - y)
    return true, state["tracker_fix_x"] - x + 1j * (state["tracker_fix_y"] - y)


@pytest.mark.parametrize(
    ("name", "more"),
    [("obstacles", {}), ("field", {}), ("search", {}), ("obstacles", {"num_obstacles": 19, "arena": 36.0})],
)
def test_sight_is_what_geometry_says(name: str, more: dict[str, Any]) -> None:
    batch = posse.batch(name, 40, field_of_view=4.0, **more)
    batch.reset(seed=1)
    rng = np.random.default_rng(1)
    seen = 0
    for _ in range(20):
        state = snapshot(batch)
        for e in range(batch.num_worlds):
            world = one_world(state, e)
            for i in range(batch.scenario.num_trackers):
                assert bool(world["tracker_sees"][i]) == can_see(batch.scenario, world, i)
                seen += int(world["tracker_sees"][i])
        for _ in range(5):
            batch.step(rng.uniform(-1, 1, batch.action_shape))
    total = 20 * batch.num_worlds * batch.scenario.num_trackers
    assert 0.02 * total < seen < 0.9 * total, "both kinds occur"


def test_a_dead_sensor_sees_nothing_and_comes_back() -> None:
    batch = posse.batch("constant", 200, sensor_outages=0.5, outage_time=2.0, horizon=100)
    batch.reset(seed=2)
    from_step = batch.state["tracker_sensor_dead_from"].copy()
    dead = np.zeros_like(from_step)
    for step in range(1, 100):
        batch.step(np.zeros(batch.action_shape))
        blind = batch.state["tracker_sees"] == 0
        np.testing.assert_array_equal(blind, (from_step <= step) & (step < from_step + 20))
        dead += blind
    struck = from_step < 100
    assert abs(struck.mean() - 0.5) < 4 * 0.5 / math.sqrt(struck.size)
    whole = struck & (from_step > 0) & (from_step < 80)
    assert (dead[whole] == 20).all()
    begins = from_step[struck] / 100
    assert abs(begins.mean() - 0.5) < 4 * 0.289 / math.sqrt(len(begins)), "uniform"


def test_noise_is_unbiased_has_its_deviation_and_is_cut_at_three() -> None:
    range_noise, bearing_noise = 0.05, 0.1
    batch = posse.batch(num_worlds=400, range_noise=range_noise, bearing_noise=bearing_noise)
    batch.reset(seed=4)
    ranges, bearings = [], []
    for _ in range(10):
        batch.step(np.zeros(batch.action_shape))
        true, measured = offsets(batch)
        ranges.append(np.abs(measured) / np.abs(true) - 1)
        bearings.append(np.angle(measured / true))
    cut = math.exp(-4.5)
    deviation = math.sqrt(1 - 4.5 * cut / (1 - cut))
    for errors, scale in ((np.array(ranges), range_noise), (np.array(bearings), bearing_noise)):
        count = errors.size
        assert abs(errors.mean()) < 4 * scale / math.sqrt(count)
        assert errors.std() == pytest.approx(scale * deviation, rel=4 / math.sqrt(2 * count))
        assert np.abs(errors).max() <= 3 * scale + 1e-4
        assert np.abs(errors).max() > 2.5 * scale
        # Neither successive steps nor neighbouring trackers share a draw.
        assert abs(np.corrcoef(errors[1:].ravel(), errors[:-1].ravel())[0, 1]) < 0.03
        assert abs(np.corrcoef(errors[..., 1:].ravel(), errors[..., :-1].ravel())[0, 1]) < 0.03


@pytest.mark.parametrize("beams", [1, 2, 4, 8, 13, 32])
def test_the_sonar_is_what_brute_force_finds(beams: int) -> None:
    batch = posse.batch(
        "obstacles", 12, num_trackers=8, sonar_beams=beams, start_distance=(1.0, 10.0), target_motion="agent"
    )
    observations = batch.reset(seed=5)
    near = 0
    for _ in range(2):
        readings = batch.layout.views(observations)["sonar"]
        if beams == 1:
            readings = readings[..., None]
        state = snapshot(batch)
        for e in range(12):
            world = one_world(state, e)
            for i in range(9):
                found = sonar(batch.scenario, world, i)
                np.testing.assert_allclose(readings[e, i], found, rtol=1e-4, atol=2e-3)
                near += int((found < 2.0).sum())
        for _ in range(30):
            observations = batch.step(np.full(batch.action_shape, 0.3))[0]
    assert near > 50
