"""What real robots have: lag, delay, wheels, drift, noise of headings, breaks."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.envs.engine.test_batch import played
from tests.support.reference.state import NEVER, directions, points

import posse


def test_speed_and_turn_rate_follow_the_command_with_the_lag() -> None:
    batch = posse.batch("constant", 3, actuator_lag=0.4)
    batch.reset()
    full = np.ones(batch.action_shape)
    for step in range(1, 20):
        batch.step(full)
        followed = 1 - math.exp(-0.1 * step / 0.4)
        np.testing.assert_allclose(batch.state["tracker_speed"], followed, rtol=1e-5)
        np.testing.assert_allclose(batch.state["tracker_turn_rate"], 2 * followed, rtol=1e-5)


def test_commands_are_executed_after_the_delay() -> None:
    late, prompt = (posse.batch("smart", 4, seed=1, command_delay=delay) for delay in (3, 0))
    late.reset(), prompt.reset()
    rng, rest = np.random.default_rng(0), np.zeros(late.action_shape) - (1, 0)
    actions = [rest] * 3 + [rng.uniform(-1, 1, late.action_shape) for _ in range(40)]
    for step in range(40):
        late.step(actions[step + 3])
        prompt.step(actions[step])
        for name in ("x", "y", "speed", "turn_rate"):
            np.testing.assert_array_equal(late.arrays.tracker[name], prompt.arrays.tracker[name])


@settings(max_examples=10)
@given(st.integers(0, 2**32), st.sampled_from([0.0, 0.5]), st.sampled_from([math.inf, 2.0]))
def test_no_wheel_turns_faster_than_the_greatest_speed(seed: int, lag: float, acceleration: float) -> None:
    batch = posse.batch("field", 2, wheel_base=0.6, actuator_lag=lag, tracker_acceleration=acceleration)
    batch.reset(seed=seed)
    rng = np.random.default_rng(seed)
    for _ in range(30):
        before = batch.arrays.tracker["speed"].copy()
        batch.step(rng.uniform(-1, 1, batch.action_shape))
        after, free = batch.arrays.tracker, batch.working & (batch.arrays.tracker["touching"] == 0)
        assert (np.abs(after["speed"] - before)[free] <= acceleration * batch.scenario.control_step + 1e-5).all()
        wheel = after["speed"] + 0.3 * np.abs(after["turn_rate"])
        assert (wheel <= after["max_speed"] * (1 + 1e-6)).all()


def test_a_robot_that_turns_as_fast_as_its_wheels_can_stands() -> None:
    for rate in np.linspace(0.5, 3.0, 40):
        batch = posse.batch("constant", tracker_turn_rate=float(rate), wheel_base=2 / float(rate))
        batch.reset(seed=0)
        observations = batch.step(np.ones(batch.action_shape))[0]
        speed = batch.layout.views(observations)["speed"]
        assert ((speed >= 0) & (speed < 1e-6)).all()


def test_own_poses_drift_as_random_walks() -> None:
    batch = played("constant", 300, steps=100, odometry_drift=0.1, heading_drift=0.03)
    v = batch.layout.views(batch.observe())
    turned = np.angle(v["heading"] @ [1, 1j] / directions(batch, "tracker"))
    for error, wanted in (
        (v["position"][..., 0] - batch.state["tracker_x"], 0.1),
        (v["position"][..., 1] - batch.state["tracker_y"], 0.1),
        (turned, 0.03),
    ):
        assert np.std(error) == pytest.approx(wanted * math.sqrt(10.0), rel=0.1)
        assert abs(np.mean(error)) < 4 * np.std(error) / math.sqrt(error.size)


def test_what_a_robot_reports_is_placed_by_its_believed_pose() -> None:
    batch = played("constant", 20, steps=50, odometry_drift=0.2, heading_drift=0.1)
    v, true = batch.layout.views(batch.observe()), directions(batch, "tracker")
    own, known = v["position"] @ [1, 1j], v["heading"] @ [1, 1j]
    # Team-mates are where they say that they are.
    others = own[..., None] + v["neighbour_range"] * (v["neighbour_bearing"] @ [1, 1j]) * known[..., None]
    number = v["neighbour_number"].astype(int)
    told = np.take_along_axis(own[:, None], number.reshape(20, 1, -1), axis=2).reshape(number.shape)
    np.testing.assert_allclose(others, told, atol=1e-4)
    # Each sees the target truly from where it is; here all do.
    away = points(batch, "world")[:, None] - points(batch, "tracker")
    np.testing.assert_allclose(v["target_range"] * (v["target_bearing"] @ [1, 1j]), away / true, atol=1e-3)
    np.testing.assert_allclose(v["target_heading"] @ [1, 1j], directions(batch, "world")[:, None] / true, atol=1e-4)
    assert np.abs(known - true).max() > 0.1


def test_the_measured_heading_of_the_target_is_noisy_and_with_it_the_slot_frame() -> None:
    batch = posse.batch("constant", 200, heading_noise=0.1)
    v = batch.layout.views(batch.reset())
    own, heading, frame = (v[name] @ [1, 1j] for name in ("heading", "target_heading", "target_frame"))
    error = np.angle(heading * own / directions(batch, "world")[:, None])
    # Trackers share the newest fix, and at the start each has its own.
    assert np.std(error) == pytest.approx(0.1, rel=0.1)
    np.testing.assert_allclose(frame, heading, atol=1e-6)  # ψ is the heading at the start


@pytest.mark.parametrize("number", [1, 4])
def test_drawn_trackers_break_at_drawn_times(number: int) -> None:
    batch = posse.batch(
        num_worlds=300, breaks=number, break_choice="drawn", break_window=(0.3, 0.7), horizon=100, autoreset="disabled"
    )
    batch.reset(seed=1)
    for _ in range(100):
        batch.step(np.zeros(batch.action_shape))
        assert (batch.state["world_working"] == batch.working.sum(axis=1)).all()
    at = batch.state["tracker_broken_at"]
    assert (batch.working.sum(axis=1) == 5 - number).all()
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
        away, was_broken = np.abs(points(batch, "tracker") - points(batch, "world")[:, None]), ~batch.working
        batch.step(rng.uniform(-1, 1, batch.action_shape))
        for e in np.flatnonzero((~batch.working & ~was_broken).any(axis=1)):
            new = np.flatnonzero(~batch.working[e] & ~was_broken[e])
            assert new.tolist() == [np.where(was_broken[e], np.inf, away[e]).argmin()]
    times = np.sort(batch.state["tracker_broken_at"], axis=1)
    assert (times[:, 3:] == NEVER).all()
    assert (times[:, 0] >= 20).all()
    assert (np.diff(times[:, :3], axis=1) >= 1).all(), "one at a time"
    assert (times[:, 2] <= 62).all(), "the window is not left, but for a step each"
    assert np.ptp(times[:, 0]) > 25, "the first is drawn from all of the window"


def test_all_break_even_in_the_last_steps() -> None:
    batch = posse.batch("leader-loss", 100, breaks=4, break_window=(0.9, 1.0), horizon=60, autoreset="disabled")
    batch.reset(seed=3)
    for _ in range(60):
        batch.step(np.zeros(batch.action_shape))
    assert (batch.working.sum(axis=1) == 1).all()
