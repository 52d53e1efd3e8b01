"""Contact: nothing passes into or through anything, and every contact is counted once."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.support.reference.state import one_world, positions, snapshot

import posse


def at(batch: posse.Batch, target: list[float], *trackers: list[float]) -> None:
    batch.reset(options={"tracker_pose": list(trackers), "target_pose": target})


def act(batch: posse.Batch, *actions: list[float]) -> dict[str, Any]:
    return batch.step(np.array([actions], np.float32))[-1]


@settings(derandomize=True, max_examples=60, deadline=None)
@given(
    speed=st.floats(1.0, 100.0),
    away=st.floats(0.5, 9.0),
    bearing=st.floats(-math.pi, math.pi),
    miss=st.floats(-0.6, 0.6),
    obstacle=st.booleans(),
)
def test_a_fast_robot_stops_where_it_meets_what_is_in_its_way(
    speed: float, away: float, bearing: float, miss: float, obstacle: bool
) -> None:
    """Against the intersection of a straight line with a circle."""
    batch = posse.batch(num_trackers=2, tracker_speed=speed, physics_step=0.1, target_speed=0.5, horizon=30)
    direction = np.exp(1j * bearing)
    start = -direction * (away + 0.3) + 1j * direction * miss
    at(batch, [15.0, 15.0, 0.0], [start.real, start.imag, bearing], [0.0, 0.0, 0.0])
    act(batch, [1.0, 0.0], [-1.0, 0.0])
    place = positions(one_world(snapshot(batch), 0))[0]
    along = ((place - start) * np.conj(direction)).real
    reach, step = 0.3 + 0.0005, speed * 0.1
    free = step
    if abs(miss) < reach:
        free = min(step, away + 0.3 - math.sqrt(reach**2 - miss**2))
    assert along == pytest.approx(free, abs=2e-3 if abs(abs(miss) - reach) < 1e-3 else 2e-4)
    assert abs(place) > 0.3


@pytest.mark.parametrize("speed", [1.0, 40.0])
def test_walls_hold(speed: float) -> None:
    batch = posse.batch(num_trackers=4, arena=10.0, tracker_speed=speed, start_distance=(1.0, 5.0))
    at(
        batch,
        [0.0, 0.0, 1.0],
        [4.0, 1.0, 0.0],
        [-4.0, 1.0, math.pi],
        [1.0, 4.0, math.pi / 2],
        [1.0, -4.0, -math.pi / 2],
    )
    for _ in range(30):
        infos = act(batch, *[[1.0, 0.0]] * 4)
    state = one_world(snapshot(batch), 0)
    reached = np.max(np.abs([state["tracker_x"], state["tracker_y"]]), axis=0)
    np.testing.assert_allclose(reached, 10 / 2 - 0.15, atol=0.001)
    assert (reached < 4.85).all()
    assert state["world_contacts_obstacle"] == 4, "once each, though all kept pushing"
    assert (infos["reward/contact"] == 0).all()
