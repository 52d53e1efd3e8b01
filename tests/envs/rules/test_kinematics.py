"""Motion: the exact arc, its limits, and the error of float32."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.support.reference.motion import on_arc

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
