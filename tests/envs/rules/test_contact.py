"""Motion and contact: exact arcs, walls and discs that hold."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.support.reference.motion import on_arc
from tests.support.reference.state import one_world, positions, snapshot

import posse
from posse.rules import arc

F = np.float32


@settings(derandomize=True, max_examples=300, deadline=None)
@given(
    theta=st.floats(-math.pi, math.pi),
    speed=st.floats(0, 100),
    turn=st.one_of(st.floats(-1, 1), st.floats(-1e-6, 1e-6)),
    time=st.sampled_from([0.01, 0.05, 0.1, 1.0]),
)
def test_a_step_lies_on_the_circle(theta: float, speed: float, turn: float, time: float) -> None:
    rate = turn / time  # the turn in one step is at most 1 rad
    dx, dy, c, s = arc(F(math.cos(theta)), F(math.sin(theta)), F(speed), F(rate), F(time))
    start = complex(F(math.cos(theta)), F(math.sin(theta)))
    place, heading = on_arc(0j, start, float(F(speed)), float(F(rate)), float(F(time)))
    assert abs(complex(dx, dy) - place) <= 2e-6 * speed * time + 1e-12
    assert abs(complex(c, s) - heading / abs(heading)) < 2e-6


def test_a_heading_stays_a_unit_vector_for_many_steps() -> None:
    batch = posse.batch(num_worlds=64, num_trackers=3, horizon=10_000, arena=400.0, start_distance=(50.0, 90.0))
    batch.reset(seed=1)
    rng = np.random.default_rng(1)
    several = rng.uniform(-1, 1, (16, *batch.action_shape)).astype(np.float32)
    for k in range(10_000):
        batch.step(several[k % 16])
    state = batch.state
    for name in ("tracker_heading", "world_heading", "world_frame"):
        length = np.hypot(state[f"{name}_cos"].astype(float), state[f"{name}_sin"])
        np.testing.assert_allclose(length, 1.0, rtol=0, atol=3e-7)


@settings(derandomize=True, max_examples=60, deadline=None)
@given(
    speed=st.floats(1.0, 100.0),
    away=st.floats(0.5, 9.0),
    bearing=st.floats(-math.pi, math.pi),
    miss=st.floats(-0.6, 0.6),
)
def test_a_fast_robot_stops_where_it_meets_what_is_in_its_way(
    speed: float, away: float, bearing: float, miss: float
) -> None:
    """Against the intersection of a straight line with a circle."""
    batch = posse.batch(num_trackers=2, tracker_speed=speed, physics_step=0.1, target_speed=0.5, horizon=30)
    direction = np.exp(1j * bearing)
    start = -direction * (away + 0.3) + 1j * direction * miss
    poses = [[start.real, start.imag, bearing], [0.0, 0.0, 0.0]]
    batch.reset(options={"tracker_pose": poses, "target_pose": [15.0, 15.0, 0.0]})
    batch.step(np.array([[[1.0, 0.0], [-1.0, 0.0]]]))
    place = positions(one_world(snapshot(batch), 0))[0]
    along = ((place - start) * np.conj(direction)).real
    reach, step = 0.3 + 0.0005, speed * 0.1
    free = step
    if abs(miss) < reach:
        free = min(step, away + 0.3 - math.sqrt(reach**2 - miss**2))
    assert along == pytest.approx(free, abs=2e-3 if abs(abs(miss) - reach) < 1e-3 else 2e-4)
    assert abs(place) > 0.3
