"""Guidance laws against closed forms, and against motion recomputed here in plain Python."""

from __future__ import annotations

import cmath
import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from posse_baselines.laws import guidance

if TYPE_CHECKING:
    from collections.abc import Callable

PROPERTY = settings(derandomize=True, database=None, deadline=None, max_examples=100)
SIMULATED_PROPERTY = settings(PROPERTY, max_examples=40)

ANGLES = st.floats(-math.pi, math.pi)
QUADRANTS = (-2.6, -0.7, 0.4, 2.2)

Pose = tuple[complex, float]
"""A position in the complex plane (m) and a heading (rad), which is not wrapped."""


def move(pose: Pose, speed: float, omega: float, dt: float) -> Pose:
    """Follow a circular arc: its chord has the direction of the heading at half the turn."""
    position, theta = pose
    half = omega * dt / 2
    chord = speed * dt * (math.sin(half) / half if half else 1.0)
    return position + cmath.rect(chord, theta + half), theta + omega * dt


def short_way(angle: float) -> float:
    return cmath.phase(cmath.exp(1j * angle))


def sight(tracker: Pose, target: Pose) -> tuple[float, float]:
    return guidance.line_of_sight(tracker[0].real, tracker[0].imag, target[0].real, target[0].imag)


def pursue(
    tracker: Pose,
    target: Pose,
    speed: float,
    target_speed: float,
    max_omega: float,
    dt: float,
    navigation_constant: float = 1.0,
    delta: float = 0.0,
) -> float:
    """Return the turn rate of the intact law in a given situation."""
    r, sigma = sight(tracker, target)
    rate = guidance.bearing_rate(
        r,
        target_speed,
        guidance.deviation(target[1], sigma),
        speed,
        guidance.deviation(tracker[1], sigma),
    )
    return guidance.intact_law(tracker[1], sigma, rate, navigation_constant, delta, max_omega, dt)


# --- geometry of a pair --------------------------------------------------------------------------


@PROPERTY
@given(st.floats(-100.0, 100.0))
def test_wrap_keeps_the_direction(angle: float) -> None:
    wrapped = guidance.wrap(angle)
    assert -math.pi < wrapped <= math.pi
    assert cmath.exp(1j * wrapped) == pytest.approx(cmath.exp(1j * angle), abs=1e-12)


@pytest.mark.parametrize(
    ("angle", "wrapped"),
    [(0.0, 0.0), (math.pi, math.pi), (-math.pi, math.pi), (3 * math.pi, math.pi), (-3.0, -3.0)],
)
def test_wrap_at_its_ends(angle: float, wrapped: float) -> None:
    assert guidance.wrap(angle) == wrapped


def test_line_of_sight_points_from_tracker_to_target() -> None:
    assert guidance.line_of_sight(1.0, 2.0, 1.0, 5.0) == pytest.approx((3.0, math.pi / 2))
    assert guidance.line_of_sight(1.0, 2.0, -3.0, 2.0) == pytest.approx((4.0, math.pi))
    assert guidance.line_of_sight(1.0, 2.0, -3.0, 2.0 - 1e-300)[1] == math.pi
    assert guidance.line_of_sight(1.0, 2.0, 1.0, 2.0) == (0.0, 0.0)


@PROPERTY
@given(
    st.floats(0.5, 9.0),
    ANGLES,
    ANGLES,
    ANGLES,
    st.floats(0.0, 1.0),
    st.floats(0.0, 1.0),
    st.floats(-2.0, 2.0),
    st.floats(-2.0, 2.0),
)
def test_rates_are_the_derivatives_of_range_and_bearing(
    r: float,
    sigma: float,
    theta: float,
    target_theta: float,
    speed: float,
    target_speed: float,
    omega: float,
    target_omega: float,
) -> None:
    step = 1e-5

    def gap(dt: float) -> complex:
        target = move((cmath.rect(r, sigma), target_theta), target_speed, target_omega, dt)
        return target[0] - move((0j, theta), speed, omega, dt)[0]

    delta = guidance.deviation(theta, sigma)
    target_delta = guidance.deviation(target_theta, sigma)
    range_rate = (abs(gap(step)) - abs(gap(-step))) / (2 * step)
    bearing_rate = cmath.phase(gap(step) / gap(-step)) / (2 * step)
    assert guidance.range_rate(target_speed, target_delta, speed, delta) == pytest.approx(
        range_rate, abs=1e-7
    )
    assert guidance.bearing_rate(r, target_speed, target_delta, speed, delta) == pytest.approx(
        bearing_rate, abs=1e-7
    )


def test_bearing_rate_is_finite_where_the_robots_coincide() -> None:
    assert math.isfinite(guidance.bearing_rate(0.0, 1.0, 1.0, 1.0, -1.0))


# --- heading regulation --------------------------------------------------------------------------


@PROPERTY
@given(ANGLES, ANGLES, st.floats(0.3, 4.0), st.floats(0.02, 0.3))
def test_regulation_turns_the_short_way_at_the_limit_and_stops_there(
    theta: float, wanted: float, limit: float, dt: float
) -> None:
    error = short_way(wanted - theta)
    assume(abs(error) < math.pi - 1e-6)
    turned = 0.0
    for _ in range(math.floor(abs(error) / (limit * dt))):
        omega = guidance.regulate_heading(theta + turned, wanted, 0.0, limit, dt)
        assert omega == pytest.approx(math.copysign(limit, error))
        turned += omega * dt
    omega = guidance.regulate_heading(theta + turned, wanted, 0.0, limit, dt)
    assert abs(omega) <= limit
    assert turned + omega * dt == pytest.approx(error, abs=1e-9)


@PROPERTY
@given(ANGLES, ANGLES, st.floats(0.5, 4.0), st.floats(-0.9, 0.9), st.sampled_from((0.02, 0.1, 0.2)))
def test_regulation_towards_a_turning_heading_never_overshoots(
    theta: float, wanted: float, limit: float, share: float, dt: float
) -> None:
    rate = share * limit
    error = short_way(wanted - theta)
    assume(abs(error) < math.pi - 1e-6)
    first = error
    for _ in range(math.ceil(abs(error) / ((1.0 - abs(share)) * limit * dt)) + 2):
        omega = guidance.regulate_heading(theta, wanted, rate, limit, dt)
        assert abs(omega) <= limit
        theta += omega * dt
        wanted += rate * dt
        previous, error = error, short_way(wanted - theta)
        assert abs(error) <= abs(previous) + 1e-9
        assert error * first >= -1e-9
    assert error == pytest.approx(0.0, abs=1e-9)
    assert guidance.regulate_heading(theta, wanted, rate, limit, dt) == pytest.approx(rate)


# --- the intact law ------------------------------------------------------------------------------


def test_each_law_is_the_intact_law() -> None:
    situation = (0.3, -0.2, 0.1)
    limits = (2.0, 0.1)
    law = guidance.intact_law
    assert guidance.velocity_pursuit(*situation, *limits) == law(*situation, 1.0, 0.0, *limits)
    assert guidance.deviated_pursuit(*situation, 0.2, *limits) == law(*situation, 1.0, 0.2, *limits)
    assert guidance.proportional_navigation(*situation, 1.1, *limits) == law(
        *situation, 1.1, 0.0, *limits
    )


@PROPERTY
@given(ANGLES, st.floats(-0.1, 0.1))
def test_proportional_navigation_deviates_by_m_sigma(sigma: float, m: float) -> None:
    heading = guidance.lawful_heading(sigma, 1.0 + m, 0.0)
    deviation = guidance.deviation(heading, sigma)
    assert deviation == pytest.approx(m * guidance.wrap(sigma), abs=1e-9)
    assert abs(deviation) <= 0.1 * math.pi + 1e-9


def test_feed_forward_is_k_times_the_turn_of_the_line_of_sight() -> None:
    for k in (0.9, 1.0, 1.1):
        lawful = k * 0.7
        assert guidance.intact_law(lawful, 0.7, 0.4, k, 0.0, 2.0, 0.1) == pytest.approx(k * 0.4)


@pytest.mark.parametrize(
    "k_and_delta", [(1.0, 0.0), (1.0, 0.4), (1.0, -0.4), (1.1, 0.0), (0.9, 0.0)]
)
@pytest.mark.parametrize("bearing", QUADRANTS)
@pytest.mark.parametrize("theta", QUADRANTS)
def test_every_law_is_taken_up_from_every_quadrant(
    theta: float, bearing: float, k_and_delta: tuple[float, float]
) -> None:
    k, delta = k_and_delta
    limit, dt, speed, target_speed = 2.0, 0.02, 0.8, 0.6
    tracker: Pose = (0j, theta)
    target: Pose = (cmath.rect(6.0, bearing), bearing + 1.0)
    obeys = False
    for _ in range(120):
        line = target[0] - tracker[0]
        error = short_way(k * cmath.phase(line) + delta - tracker[1])
        velocities = cmath.rect(target_speed, target[1]) - cmath.rect(speed, tracker[1])
        feed_forward = k * (velocities / line).imag
        omega = pursue(tracker, target, speed, target_speed, limit, dt, k, delta)
        assert abs(omega) <= limit
        if abs(error) > (limit + abs(feed_forward)) * dt:
            assert not obeys
            assert omega == math.copysign(limit, error)
        else:
            obeys = True
            assert omega == pytest.approx(
                np.clip(feed_forward + error / dt, -limit, limit), abs=1e-9
            )
        tracker = move(tracker, speed, omega, dt)
        target = move(target, target_speed, 0.3, dt)
    line = target[0] - tracker[0]
    assert short_way(k * cmath.phase(line) + delta - tracker[1]) == pytest.approx(0, abs=1e-4)


# --- velocity pursuit in closed form -------------------------------------------------------------


def pursuit_invariant(k: float, r: float, phi: float, target_speed: float, time: float) -> float:
    return r * (k + math.cos(phi)) + target_speed * (k**2 - 1) * time


def run_pursuit(k: float, aspect: float, last_range: float, dt: float) -> tuple[float, float]:
    """Return the largest error of the closed form on the way, and the time of the last range."""
    target_speed, sigma = 0.5, 0.8
    target: Pose = (cmath.rect(4.0, sigma), sigma + aspect)
    tracker: Pose = (0j, sigma)
    first = pursuit_invariant(k, 4.0, aspect, target_speed, 0.0)
    worst, time = 0.0, 0.0
    while (line := target[0] - tracker[0]) and abs(line) > last_range:
        phi = target[1] - cmath.phase(line)
        now = pursuit_invariant(k, abs(line), phi, target_speed, time)
        worst = max(worst, abs(now - first) / first)
        omega = pursue(tracker, target, k * target_speed, target_speed, 100.0, dt)
        tracker = move(tracker, k * target_speed, omega, dt)
        target = move(target, target_speed, 0.0, dt)
        time += dt
    return worst, time


@pytest.mark.parametrize("aspect", [-3.0, -1.8, -0.9, 0.0, 0.5, 1.5, 2.4])
@pytest.mark.parametrize("k", [1.2, 1.5, 2.0, 3.0])
def test_velocity_pursuit_follows_the_closed_form(k: float, aspect: float) -> None:
    last_range = 0.02 if k <= 2.0 else 0.8
    dt = 4.0 / 0.5 / 800.0
    worst, time = run_pursuit(k, aspect, last_range, dt)
    assert worst < 6e-4
    intercept = 4.0 * (k + math.cos(aspect)) / (0.5 * (k**2 - 1))
    left = last_range * (k + 1.0) / (0.5 * (k**2 - 1))
    assert intercept - left - dt <= time <= intercept + dt


def test_pursuit_error_falls_with_the_square_of_the_step() -> None:
    coarse, fine = (run_pursuit(1.5, 1.5, 1.0, dt)[0] for dt in (0.04, 0.02))
    assert coarse / fine == pytest.approx(4.0, rel=0.1)


# --- pursuit of a target on a circle -------------------------------------------------------------


@pytest.mark.parametrize("turn", [0.3, -0.3])
@pytest.mark.parametrize("k", [0.5, 0.8])
def test_slower_tracker_settles_on_a_concentric_circle(k: float, turn: float) -> None:
    radius = 2.0
    centre = 1j * math.copysign(radius, turn)
    target: Pose = (0j, 0.0)
    tracker: Pose = (-3.0 + 1.0j, 2.0)
    dt, target_speed = 0.02, abs(turn) * radius
    for _ in range(5000):
        omega = pursue(tracker, target, k * target_speed, target_speed, 3.0, dt)
        tracker = move(tracker, k * target_speed, omega, dt)
        target = move(target, target_speed, turn, dt)
    own = abs(tracker[0] - centre)
    assert own == pytest.approx(k * radius, rel=3e-3)
    assert math.hypot(own, abs(target[0] - tracker[0])) == pytest.approx(radius, rel=3e-3)


@pytest.mark.parametrize("wanted", [0.6, 1.2])
def test_tracker_that_keeps_its_range_settles_on_a_concentric_circle(wanted: float) -> None:
    radius, turn, dt = 2.0, 0.3, 0.02
    target: Pose = (0j, 0.0)
    tracker: Pose = (-wanted + 0j, 0.0)
    speed, target_speed = 0.6, turn * radius
    for _ in range(2500):
        r, sigma = sight(tracker, target)
        deviations = (short_way(target[1] - sigma), short_way(tracker[1] - sigma))
        speed = guidance.maintenance_speed(target_speed, *deviations, r, wanted, 1.0, 5.0)
        omega = pursue(tracker, target, speed, target_speed, 3.0, dt)
        tracker = move(tracker, speed, omega, dt)
        target = move(target, target_speed, turn, dt)
    own = math.sqrt(radius**2 - wanted**2)
    assert abs(tracker[0] - 1j * radius) == pytest.approx(own, rel=5e-3)
    assert abs(target[0] - tracker[0]) == pytest.approx(wanted, rel=5e-3)
    assert speed / target_speed == pytest.approx(own / radius, rel=5e-3)


# --- the speed of the maintenance stage ----------------------------------------------------------


@PROPERTY
@given(ANGLES, ANGLES, st.floats(-0.1, 0.1), st.floats(0.0, 1.0))
def test_matching_speed_rests_the_range(
    target_theta: float, sigma: float, m: float, target_speed: float
) -> None:
    target_delta = guidance.deviation(target_theta, sigma)
    speed = guidance.matching_speed(target_speed, target_delta, m * sigma)
    rate = target_speed * math.cos(target_theta - sigma) - speed * math.cos(m * sigma)
    assert rate == pytest.approx(0.0, abs=1e-12)


@PROPERTY
@given(
    st.floats(-1.2, 1.2),
    st.floats(-0.31, 0.31),
    st.floats(0.1, 0.9),
    st.floats(0.5, 5.0),
    st.floats(0.5, 3.0),
    st.floats(0.1, 2.0),
)
def test_maintenance_speed_corrects_the_range_and_obeys_the_limits(
    target_delta: float, delta: float, target_speed: float, r: float, wanted: float, gain: float
) -> None:
    speed = guidance.maintenance_speed(target_speed, target_delta, delta, r, wanted, gain, 1.0)
    assert 0.0 <= speed <= 1.0
    rate = target_speed * math.cos(target_delta) - speed * math.cos(delta)
    asked = gain * (wanted - r)
    if 0.0 < speed < 1.0:
        assert rate == pytest.approx(asked, abs=1e-12)
    elif speed == 0.0:
        assert rate <= asked + 1e-12
    else:
        assert rate >= asked - 1e-12


@pytest.mark.parametrize("k", [0.9, 1.0, 1.1])
@pytest.mark.parametrize("target_theta", [-2.5, -1.0, 0.5, 2.0, 2.8])
def test_bearing_settles_at_the_stated_rate(k: float, target_theta: float) -> None:
    wanted, target_speed, dt = 1.5, 0.6, 0.01
    settled = target_theta / k
    m = k - 1.0
    sigma = settled + 0.02
    target: Pose = (0j, target_theta)
    tracker: Pose = (cmath.rect(-wanted, sigma), k * sigma)
    errors = []
    for _ in range(401):
        r, sigma = sight(tracker, target)
        errors.append(short_way(sigma - settled))
        deviations = (short_way(target_theta - sigma), short_way(tracker[1] - sigma))
        speed = guidance.maintenance_speed(target_speed, *deviations, r, wanted, 1.0, 5.0)
        omega = pursue(tracker, target, speed, target_speed, 3.0, dt, k)
        tracker = move(tracker, speed, omega, dt)
        target = move(target, target_speed, 0.0, dt)
    rate = math.log(errors[0] / errors[400]) / (400 * dt)
    assert rate == pytest.approx(k * target_speed / (wanted * math.cos(m * settled)), rel=0.01)


# --- the range closes ----------------------------------------------------------------------------


@SIMULATED_PROPERTY
@given(
    st.floats(-0.1, 0.1),
    st.floats(0.5, 1.5),
    st.floats(0.8, 3.0),
    st.floats(0.0, 0.9),
    ANGLES,
    ANGLES,
    ANGLES,
    st.lists(st.floats(-1.0, 1.0), min_size=12, max_size=12),
)
def test_range_closes_where_it_is_promised(
    m: float,
    speed: float,
    limit: float,
    ratio: float,
    theta: float,
    sigma: float,
    target_theta: float,
    turns: list[float],
) -> None:
    dt, target_speed = 0.05, ratio * speed
    reach = 2.0 * speed / limit
    regulation = 2.0 * speed * math.pi / limit
    tracker: Pose = (0j, theta)
    target: Pose = (cmath.rect(reach + regulation + 1.0, sigma), target_theta)
    regulated = 0
    for turn in turns:
        for _ in range(15):
            line = target[0] - tracker[0]
            if abs(line) <= reach:
                return
            lawful = (1.0 + m) * cmath.phase(line)
            omega = pursue(tracker, target, speed, target_speed, limit, dt, 1.0 + m)
            if abs(short_way(lawful - tracker[1])) < 0.02 or regulated:
                regulated += 1
            tracker = move(tracker, speed, omega, dt)
            target = move(target, target_speed, turn, dt)
            if regulated:
                assert abs(target[0] - tracker[0]) < abs(line)
    assert regulated > 1


# --- the two stages ------------------------------------------------------------------------------


def test_stage_switches_with_hysteresis() -> None:
    stage, seen = guidance.CHASE, []
    for r in (3.0, 1.4, 1.2, 1.4, 1.6, 1.4, 1.19):
        stage = guidance.next_stage(stage, r, 1.0, 0.2, 0.5)
        seen.append(stage)
    assert seen == [0, 0, 1, 1, 0, 0, 1]
    assert (guidance.CHASE, guidance.MAINTENANCE) == (0, 1)


@pytest.mark.parametrize("theta", QUADRANTS)
def test_chase_and_maintenance_end_at_the_wanted_range(theta: float) -> None:
    dt, wanted, target_speed = 0.1, 1.0, 0.6
    tracker: Pose = (0j, theta)
    target: Pose = (4.0 + 4.0j, 0.4)
    stage, switches = guidance.CHASE, 0
    for _ in range(400):
        r, sigma = sight(tracker, target)
        before, stage = stage, guidance.next_stage(stage, r, wanted, 0.3, 0.6)
        switches += before != stage
        speed = guidance.pursuit_speed(
            stage,
            target_speed,
            guidance.deviation(target[1], sigma),
            guidance.deviation(tracker[1], sigma),
            r,
            wanted,
            1.0,
            1.0,
        )
        assert 0.0 <= speed <= 1.0
        assert speed == 1.0 or stage == guidance.MAINTENANCE
        omega = pursue(tracker, target, speed, target_speed, 2.0, dt)
        tracker = move(tracker, speed, omega, dt)
        target = move(target, target_speed, 0.0, dt)
    assert switches == 1
    assert abs(target[0] - tracker[0]) == pytest.approx(wanted, abs=1e-3)
    assert short_way(tracker[1] - 0.4) == pytest.approx(0.0, abs=1e-3)


# --- compilation ---------------------------------------------------------------------------------


CALLS: list[tuple[Callable[..., Any], tuple[float, ...]]] = [
    (guidance.wrap, (4.0,)),
    (guidance.clip, (3.0, -1.0, 1.0)),
    (guidance.line_of_sight, (0.0, 1.0, 2.0, -1.0)),
    (guidance.deviation, (3.0, -2.0)),
    (guidance.range_rate, (0.6, 1.0, 1.0, 0.2)),
    (guidance.bearing_rate, (2.0, 0.6, 1.0, 1.0, 0.2)),
    (guidance.regulate_heading, (0.0, 0.1, 0.2, 2.0, 0.1)),
    (guidance.lawful_heading, (2.0, 1.1, 0.0)),
    (guidance.intact_law, (0.1, 0.2, 0.3, 1.1, 0.0, 2.0, 0.1)),
    (guidance.velocity_pursuit, (0.1, 0.2, 0.3, 2.0, 0.1)),
    (guidance.deviated_pursuit, (0.1, 0.2, 0.3, 0.1, 2.0, 0.1)),
    (guidance.proportional_navigation, (0.1, 0.2, 0.3, 1.1, 2.0, 0.1)),
    (guidance.matching_speed, (0.6, 1.0, 0.2)),
    (guidance.maintenance_speed, (0.6, 1.0, 0.2, 1.5, 1.0, 0.5, 1.0)),
]


@pytest.mark.parametrize("call", CALLS, ids=lambda call: str(call[0].__name__))
def test_compiled_and_plain_function_agree_in_both_precisions(
    call: tuple[Callable[..., Any], tuple[float, ...]],
) -> None:
    function, arguments = call
    plain = getattr(function, "py_func", function)
    expected = plain(*arguments)
    assert function(*arguments) == pytest.approx(expected, rel=1e-12)
    single = [np.float32(value) for value in arguments]
    assert function(*single) == pytest.approx(expected, abs=1e-5)
