"""Motion: the exact arc, its limits, and the error of float32."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.support.reference.motion import on_arc
from tests.support.reference.state import headings, one_world, positions, snapshot

import posse
from posse.rules.kinematics import approach, arc, turn_towards

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
    assert abs(complex(dx, dy) - place) <= 1e-6 * speed * time + 1e-12
    assert abs(complex(c, s) - heading / abs(heading)) < 1e-6


def test_a_robot_that_holds_its_speeds_goes_round_the_circle_it_should() -> None:
    batch = posse.batch(target_turn_rate=2.0, target_motion="agent", num_trackers=1)
    batch.reset(options={"tracker_pose": [[5.0, 0.0, math.pi / 2]], "target_pose": [0.0, -8.0, 0.0]})
    # V = 0.75 and ω = 0.5: a circle of 1.5 m, whose centre lies 1.5 m to the left of (5, 0).
    actions = np.array([[[0.5, 0.25], [-1.0, 0.0]]], np.float32)
    for step in range(1, 127):
        batch.step(actions)
        place = complex(positions(one_world(snapshot(batch), 0))[0])
        wanted = 3.5 + 1.5 * np.exp(1j * 0.05 * step)
        assert abs(place - wanted) < 1e-5
    assert abs(place - 5.0) < 0.03, "126 steps of 0.05 rad are a full turn"


@pytest.mark.parametrize("name", ["constant", "accelerating", "smart"])
def test_the_physics_step_changes_nothing_but_rounding(name: str) -> None:
    at_once: dict[str, Any] = {"tracker_acceleration": math.inf, "tracker_turn_acceleration": math.inf}
    coarse = posse.batch(name, 8, physics_step=0.1, **at_once)
    fine = posse.batch(name, 8, physics_step=0.005, **at_once)
    coarse.reset(seed=3)
    fine.reset(seed=3)
    rng = np.random.default_rng(0)
    for _ in range(30):
        actions = rng.uniform(-1, 1, coarse.action_shape).astype(np.float32)
        coarse.step(actions)
        fine.step(actions)
        assert (snapshot(coarse)["tracker_near"] == 0).any()
    for key in ("tracker_x", "tracker_y", "world_x", "world_y", "tracker_heading_cos"):
        np.testing.assert_allclose(snapshot(coarse)[key], snapshot(fine)[key], atol=5e-5)


def test_a_heading_stays_a_unit_vector_for_a_hundred_thousand_steps() -> None:
    batch = posse.batch(num_trackers=3, horizon=100_000, arena=400.0, start_distance=(50.0, 90.0))
    batch.reset(seed=1)
    rng = np.random.default_rng(1)
    several = rng.uniform(-1, 1, (16, *batch.action_shape)).astype(np.float32)
    for k in range(100_000):
        batch.step(several[k % 16])
    world = one_world(snapshot(batch), 0)
    np.testing.assert_allclose(np.abs(headings(world)), 1.0, atol=3e-7)
    frame = complex(world["world_frame_cos"], world["world_frame_sin"])
    assert abs(abs(frame) - 1.0) < 3e-7


def test_acceleration_limits_are_kept_and_used() -> None:
    batch = posse.batch(num_worlds=4, tracker_acceleration=0.8, tracker_turn_acceleration=3.0, autoreset="disabled")
    batch.reset(seed=2)
    rng = np.random.default_rng(2)
    before = snapshot(batch)
    faster, sharper = 0.0, 0.0
    for k in range(200):
        if k % 7 == 0:
            actions = rng.choice([-1.0, 1.0], batch.action_shape)
        batch.step(actions)
        after = snapshot(batch)
        change = after["tracker_speed"] - before["tracker_speed"]
        turn = after["tracker_turn_rate"] - before["tracker_turn_rate"]
        freely = before["tracker_near"] == 0  # a robot that is blocked stops at once
        faster = max(faster, float(np.abs(change[freely]).max()))
        sharper = max(sharper, float(np.abs(turn).max()))
        assert (after["tracker_speed"] >= 0).all()
        assert (after["tracker_speed"] <= 1.0).all()
        assert (np.abs(after["tracker_turn_rate"]) <= 2.0).all()
        before = after
    assert faster == pytest.approx(0.08, abs=1e-6)
    assert sharper == pytest.approx(0.3, abs=1e-6)


def test_the_action_spans_the_limits() -> None:
    batch = posse.batch(num_trackers=3, tracker_speed=2.0, tracker_turn_rate=1.5)
    batch.reset()
    batch.step([[[-1.0, -1.0], [0.0, 0.0], [1.0, 1.0]]])
    np.testing.assert_allclose(batch.state["tracker_speed"][0], [0.0, 1.0, 2.0])
    np.testing.assert_allclose(batch.state["tracker_turn_rate"][0], [-1.5, 0.0, 1.5])


def test_approach_and_turn_towards() -> None:
    assert approach(F(1.0), F(5.0), F(0.5)) == F(1.5)
    assert approach(F(1.0), F(-5.0), F(0.5)) == F(0.5)
    assert approach(F(1.0), F(1.2), F(0.5)) == F(1.2)
    for error in (-3.0, -0.1, 0.0, 0.05, 1.0, 3.1):
        wanted = F(math.cos(2.0 + error)), F(math.sin(2.0 + error))
        rate = turn_towards(F(math.cos(2.0)), F(math.sin(2.0)), *wanted, F(1.5), F(0.1))
        assert rate == pytest.approx(max(-1.5, min(1.5, error / 0.1)), abs=1e-5)


@settings(derandomize=True, max_examples=1000, deadline=None)
@given(
    st.floats(-math.pi, math.pi),
    st.sampled_from([1e-7, 1e-3, 0.1, 0.99, 1.4, 1.5, 20.0]),
    st.sampled_from([0.0, 1e-8, 3e-7, 1e-6, 1e-3, 0.5, 0.9999, 1.0, 1.00005, 1.001, 2.0, 30.0]),
    st.sampled_from([-1.0, 1.0]),
)
def test_a_turn_is_the_angle_within_its_limit(heading: float, limit: float, share: float, side: float) -> None:
    """Also close to the limit, to zero and to an about-turn."""
    error = side * min(share * limit, math.pi)
    most, time = F(limit / 0.1), F(0.1)
    cosine, sine = F(math.cos(heading)), F(math.sin(heading))
    wanted = F(math.cos(heading + error)), F(math.sin(heading + error))
    rate = turn_towards(cosine, sine, *wanted, most, time)
    # float32 has the two headings to a ten millionth, which is what the angle can be known to.
    exact = math.atan2(
        float(cosine) * float(wanted[1]) - float(sine) * float(wanted[0]),
        float(cosine) * float(wanted[0]) + float(sine) * float(wanted[1]),
    )
    assert abs(rate) <= most
    if abs(exact) < 3.1:
        assert float(rate) * 0.1 == pytest.approx(max(-limit, min(limit, exact)), abs=3e-7)
    else:
        assert abs(float(rate)) == pytest.approx(min(float(most), math.pi / 0.1), rel=1e-3)


def test_each_tracker_moves_within_its_own_limits() -> None:
    speeds, rates = (1.0, 0.7, 1.4), (2.0, 0.5, 1.1)
    batch = posse.batch("constant", 4, num_trackers=3, tracker_speed=speeds, tracker_turn_rate=rates)
    batch.reset(seed=0)
    batch.step(np.ones(batch.action_shape, np.float32))
    np.testing.assert_allclose(batch.state["tracker_speed"], [speeds] * 4, rtol=1e-6)
    np.testing.assert_allclose(batch.state["tracker_turn_rate"], [rates] * 4, rtol=1e-6)
