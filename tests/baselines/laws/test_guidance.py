"""The laws: geometry of a pair, heading and rate, the speed of (13), a follower's demands, slots, ways, and detours."""

import cmath
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment
from tests.support.reference.state import on_arc

from posse_baselines.ddcs.memory import record
from posse_baselines.laws import formation, guidance
from posse_baselines.laws.guidance import BODY, line_of_sight, regulate
from posse_baselines.laws.safeguard import DISC, put_disc, turn_past
from posse_baselines.laws.steering import WORK_ROWS, approach_velocity, assign, slot_heading, slot_velocity, way_round

ANGLES = st.floats(-math.pi, math.pi)


def short_way(angle: float) -> float:
    return cmath.phase(cmath.exp(1j * angle))


def test_line_of_sight_points_from_tracker_to_target() -> None:
    assert line_of_sight(1 + 2j, 1 + 5j) == pytest.approx((3.0, math.pi / 2))
    assert line_of_sight(1 + 2j, complex(-3.0, 2.0 - 1e-300)) == (4.0, math.pi)
    assert line_of_sight(1 + 2j, 1 + 2j) == (0.0, 0.0)
    assert math.isfinite(guidance.bearing_rate(0.0, 1j, -1j))


@given(st.floats(0.5, 9.0), ANGLES, ANGLES, ANGLES, st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_bearing_rate_is_the_derivative_of_the_bearing(
    r: float, sigma: float, theta: float, target_theta: float, speed: float, target_speed: float
) -> None:
    def gap(dt: float) -> complex:
        target, _ = on_arc(cmath.rect(r, sigma), cmath.rect(1.0, target_theta), target_speed, 0.3, dt)
        return target - on_arc(0j, cmath.rect(1.0, theta), speed, -1.0, dt)[0]

    rate = guidance.bearing_rate(r, cmath.rect(target_speed, target_theta - sigma), cmath.rect(speed, theta - sigma))
    step = 1e-5
    assert rate == pytest.approx(cmath.phase(gap(step) / gap(-step)) / (2 * step), abs=1e-7)


@given(ANGLES, st.floats(0.9, 1.1), ANGLES, ANGLES, st.floats(-1, 1), st.floats(-1, 1))
def test_the_rate_is_the_derivative_of_the_heading(
    sigma: float, k: float, wanted_sigma: float, psi: float, sigma_rate: float, psi_rate: float
) -> None:
    assume(abs(short_way(sigma - wanted_sigma)) < math.pi - 1e-2)

    def heading(t: float) -> float:
        # σ_d and ψ turn together: the slot is fixed in the slot frame.
        turned = psi_rate * t
        return guidance.lawful_heading(sigma + sigma_rate * t, k, wanted_sigma + turned, psi + turned)

    step = 1e-4
    slope = short_way(heading(step) - heading(-step)) / (2 * step)
    assert guidance.lawful_rate(k, sigma_rate, psi_rate) == pytest.approx(slope, abs=1e-6)


@given(st.floats(0.3, 5.0), ANGLES, ANGLES, ANGLES, st.floats(0.0, 1.0), st.floats(0.3, 5.0))
def test_the_range_closes_at_its_gain(
    r: float, sigma: float, target_theta: float, delta: float, target_speed: float, wanted: float
) -> None:
    assume(abs(math.cos(delta)) > guidance.MIN_COSINE + 1e-6)
    target = cmath.rect(target_speed, target_theta)
    speed = guidance.maintenance_speed(target * cmath.rect(1.0, -sigma), delta, r, wanted, 0.2, 0.8, 50.0)
    assume(0.0 < speed < 50.0)
    tracker = cmath.rect(speed, sigma + delta)
    rate = ((target - tracker) * cmath.exp(-1j * sigma)).real
    assert rate == pytest.approx(0.8 * (wanted - r), abs=1e-9)


def test_speed_in_the_slot_is_the_slots_whatever_its_heading() -> None:
    # A target that turns, a tracker behind it and aside of it: in place, it moves with the slot.
    for psi_rate in (-0.3, 0.0, 0.3):
        for sigma in np.linspace(-3.0, 3.0, 25):
            slot = 0.6 + 1j * psi_rate * -cmath.rect(1.2, sigma)
            delta = short_way(cmath.phase(slot) - sigma)
            speed = guidance.maintenance_speed(cmath.rect(0.6, -sigma), delta, 1.2, 1.2, psi_rate, 1.0, 5.0)
            assert speed == pytest.approx(abs(slot), abs=1e-9)


def body_of(theta: float = 0.0, speed: float = 0.0, limits: tuple[float, float] = (1e4, 1e4), dt: float = 0.1) -> Any:
    """A robot of up to 1 m/s and 2 rad/s, and limits of its acceleration and turn acceleration."""
    body = record(**BODY)[0]
    body.heading, body.speed = cmath.rect(1.0, theta), speed
    body.max_speed, body.max_omega, body.dt = 1.0, 2.0, dt
    body.acceleration, body.turn_acceleration = limits
    return body


@given(ANGLES, ANGLES, st.floats(0.01, 2.0), st.floats(-0.5, 0.5))
def test_regulation_turns_the_short_way_and_never_reverses(
    theta: float, wanted: float, speed: float, rate: float
) -> None:
    error = short_way(wanted - theta)
    assume(abs(error) < math.pi - 1e-6)
    v = cmath.rect(speed, wanted)
    ahead, omega = regulate(body_of(theta), v, rate)
    assert ahead == pytest.approx(np.clip(speed * math.cos(error), 0.0, 1.0), abs=1e-9)
    held = np.clip(error / 0.1, -2.0, 2.0) + rate
    assert omega == pytest.approx(np.clip(held, -2.0, 2.0), abs=1e-9)


def test_a_zero_velocity_keeps_the_heading() -> None:
    assert regulate(body_of(0.3), -1e-4 + 1e-4j) == (0.0, 0.0)


def test_a_robot_of_limited_turn_acceleration_brakes_its_turn() -> None:
    _, omega = regulate(body_of(limits=(1e4, 1.0), dt=0.05), 1j)
    assert 1.0 < omega < math.sqrt(math.pi)  # comes to rest within a right angle at 1 rad/s²


OFFSET = 0.15


@given(st.floats(0.3, 4.0), ANGLES, ANGLES, st.floats(0.5, 2.0), ANGLES, st.floats(0.0, 1.0), st.floats(-1.0, 1.0))
def test_l_phi_asks_for_the_wanted_rates_at_every_angle(
    l_now: float, phi: float, turned: float, l_d: float, phi_d: float, leader_speed: float, leader_omega: float
) -> None:
    assume(abs(short_way(phi_d - phi)) < math.pi - 1e-6)  # at half a turn either way is right
    now, wanted = cmath.rect(l_now, phi), cmath.rect(l_d, phi_d)
    back = cmath.rect(1.0, turned)  # from the leader's axes
    velocity = formation.l_phi_velocity(now * back, wanted * back, leader_speed * back, leader_omega, 2.0, 1.5)
    along = velocity * cmath.exp(-1j * (phi + turned))  # along l, and across it
    leader = cmath.rect(leader_speed, -phi)
    assert along.real - leader.real == pytest.approx(2.0 * (l_d - l_now), abs=1e-9)
    phi_rate = (along.imag - leader.imag) / l_now - leader_omega
    assert phi_rate == pytest.approx(1.5 * short_way(phi_d - phi), abs=1e-9)


@given(st.floats(-0.5, 2.0), st.floats(-0.8, 0.8), st.sampled_from((0.01, 0.1, 0.2)))
def test_a_held_command_takes_the_control_point_where_its_velocity_leads(
    ahead: float, across: float, dt: float
) -> None:
    assume(OFFSET + 0.5 * ahead * dt > 0.02)
    speed, omega = formation.held_command(complex(ahead, across), OFFSET, dt)
    place, heading = on_arc(0j, 1 + 0j, speed, omega, dt)
    assert place + OFFSET * heading == pytest.approx(OFFSET + dt * complex(ahead, across), abs=1e-9)


@given(st.floats(-5.0, 5.0), st.floats(-20.0, 20.0))
def test_limits_hold_and_reversing_becomes_a_turn(speed: float, omega: float) -> None:
    limited = formation.limit_command(body_of(), speed, omega, OFFSET)
    if speed >= 0.0:
        assert limited == pytest.approx((np.clip(speed, 0, 1), np.clip(omega, -2, 2)))
    else:
        wanted = math.hypot(speed, omega * OFFSET) / OFFSET
        assert limited[0] == 0.0
        assert abs(limited[1]) == pytest.approx(min(wanted, 2.0))
        assert limited[1] * omega >= 0.0


@given(st.floats(-math.pi, math.pi), st.floats(1.0, 6.0), st.floats(-math.pi, math.pi))
def test_the_way_round_keeps_clear_and_arrives(start: float, away: float, end: float) -> None:
    position, goal, least = cmath.rect(away, start), cmath.rect(1.2, end), away
    for _ in range(4000):
        way = way_round(position, goal) - position
        position += 0.01 * way / max(abs(way), 0.01)
        least = min(least, abs(position))
    assert abs(position - goal) < 0.02
    assert least > 0.82 * 0.75  # the cosine of the least turn


def test_a_slot_moves_on_a_circle_of_its_own() -> None:
    arm, speed, rate, step = 0.8 - 1.1j, 0.5 + 0.2j, 0.4, 1e-6
    turned = speed * step + arm * cmath.exp(1j * rate * step)
    velocity = slot_velocity(speed, rate, arm)
    assert velocity == pytest.approx((turned - arm) / step, abs=1e-5)
    assert slot_heading(speed, rate, arm, 9.0) == pytest.approx(cmath.phase(velocity))
    assert slot_heading(1e-3j, 0.0, 1 + 0j, 0.7) == 0.7


@given(
    st.complex_numbers(min_magnitude=0.01, max_magnitude=10.0),
    st.complex_numbers(max_magnitude=0.99),
    st.floats(0.2, 3.0),
)
def test_the_slot_law_adds_an_approach_along_the_offset(offset: complex, slot: complex, gain: float) -> None:
    free = slot + gain * offset
    assert approach_velocity(offset, slot, gain, 100.0) == pytest.approx(free, abs=1e-9)
    limited = approach_velocity(offset, slot, gain, 1.0)
    if abs(free) <= 1.0:
        assert limited == pytest.approx(free, abs=1e-9)
    else:
        share = (limited - slot) / offset
        assert abs(limited) == pytest.approx(1.0)
        assert share.imag == pytest.approx(0.0, abs=1e-9)
        assert -1e-9 <= share.real <= gain


@settings(max_examples=60)
@given(st.integers(1, 24), st.integers(0, 12), st.integers(0, 12), st.integers(0, 2**31), st.booleans())
def test_the_sum_of_the_costs_is_the_least(n: int, absent: int, more: int, seed: int, ties: bool) -> None:
    cost = np.random.default_rng(seed).uniform(-5, 20, (n, n + more))
    if ties:
        cost = np.round(cost / 5)
    cost[n - min(n, absent) :] = 0.0
    # Other contents of the work space have no effect.
    work, before = np.full((WORK_ROWS, n + more + 1), 7.0), cost.copy()
    assign(cost, work)
    found = work[0, :n].astype(int)
    assert len(set(found)) == n
    best = cost[linear_sum_assignment(cost)].sum()
    assert abs(cost[np.arange(n), found].sum() - best) < 1e-9
    np.testing.assert_array_equal(cost, before)


CLEARANCE = 0.2


def turn(discs: list[tuple[float, float, float]], side: float, speed: float = 0.0) -> float:
    """The turn of a robot that heads along the x-axis, past discs (x, y, reach)."""
    records, count = np.zeros(8, DISC), 0
    for x, y, reach in discs:
        count = put_disc(records, count, complex(x, y), complex(speed), reach, 0.1)
    return float(turn_past(records[:count], CLEARANCE, 1 + 0j, side))


@pytest.mark.parametrize("y", [-0.3, 0.0, 0.5])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_way_past_a_disc_is_its_tangent(y: float, side: float) -> None:
    x, reach = 1.7, 0.6
    angle = turn([(x, y, reach)], side)
    miss = x * math.sin(angle) - y * math.cos(angle)  # by which the line in that direction passes the centre
    assert side * miss == pytest.approx(reach + CLEARANCE)
    assert abs(angle) < math.pi / 2


def test_what_is_not_in_the_way_is_passed_straight() -> None:
    assert turn([(1.0, 0.9, 0.6), (-0.5, 0.0, 0.4)], 1.0) == 0.0  # beside and behind
    assert turn([(1.0, 0.0, 0.6)], 1.0, speed=0.1) == 0.0  # it moves: left to the safeguard
    assert turn([(1001.0, 0.0, 1000.0)], 1.0) == 0.0  # a wall
