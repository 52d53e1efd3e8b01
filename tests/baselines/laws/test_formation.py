"""l-φ, l-l and the slot law: demands on a follower, recomputed in complex numbers."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from posse_baselines.laws import l_l, l_phi, slots

PROPERTY = settings(derandomize=True, database=None, deadline=None, max_examples=100)
ANGLES = st.floats(-math.pi, math.pi)
OFFSET = 0.15


def short_way(angle: float) -> float:
    return cmath.phase(cmath.exp(1j * angle))


# --- l-φ -----------------------------------------------------------------------------------------


@PROPERTY
@given(st.floats(0.3, 4.0), ANGLES, ANGLES, st.floats(0.5, 2.0), ANGLES, st.floats(0.0, 1.0), st.floats(-1.0, 1.0))
def test_l_phi_asks_for_the_wanted_rates_at_every_angle(
    l_now: float, phi: float, gamma: float, l_d: float, phi_d: float, leader_speed: float, leader_omega: float
) -> None:
    demand = l_phi.l_phi_demand(l_now, phi, l_d, phi_d, leader_speed, leader_omega, 2.0, 1.5)
    point = complex(*l_phi.point_velocity(*demand, gamma))  # in the follower's own axes
    along = point * cmath.exp(-1j * gamma)  # along l, and across it
    leader = cmath.rect(leader_speed, -phi)
    assert along.real - leader.real == pytest.approx(2.0 * (l_d - l_now), abs=1e-9)
    phi_rate = (along.imag - leader.imag) / l_now - leader_omega
    assert phi_rate == pytest.approx(1.5 * short_way(phi_d - phi), abs=1e-9)


@PROPERTY
@given(st.floats(-0.5, 2.0), st.floats(-0.8, 0.8), st.sampled_from((0.01, 0.1, 0.2)))
def test_a_held_command_takes_the_control_point_where_its_velocity_leads(
    ahead: float, across: float, dt: float
) -> None:
    assume(OFFSET + 0.5 * ahead * dt > 0.02)
    speed, omega = l_phi.held_command(ahead, across, OFFSET, dt)
    half = omega * dt / 2
    chord = speed * dt * (math.sin(half) / half if half else 1.0)
    point = cmath.rect(chord, half) + cmath.rect(OFFSET, omega * dt)
    assert point == pytest.approx(OFFSET + dt * complex(ahead, across), abs=1e-9)


def test_for_a_short_step_the_held_command_is_the_paper_s() -> None:
    speed, omega = l_phi.held_command(0.7, 0.3, OFFSET, 1e-6)
    assert (speed, omega) == pytest.approx((0.7, 0.3 / OFFSET), rel=1e-4)


def test_the_sampled_rate_leaves_what_an_exponential_leaves() -> None:
    for alpha, dt in ((2.0, 0.1), (0.5, 0.02)):
        left = 1.0 - dt * l_phi.sampled_rate(alpha, dt)
        assert left == pytest.approx(math.exp(-alpha * dt))


@PROPERTY
@given(st.floats(-5.0, 5.0), st.floats(-20.0, 20.0))
def test_limits_hold_and_reversing_becomes_a_turn(speed: float, omega: float) -> None:
    limited = l_phi.limit_command(speed, omega, OFFSET, 1.0, 2.0)
    if speed >= 0.0:
        assert limited == pytest.approx((np.clip(speed, 0, 1), np.clip(omega, -2, 2)))
    else:
        wanted = math.hypot(speed, omega * OFFSET) / OFFSET
        assert limited[0] == 0.0
        assert abs(limited[1]) == pytest.approx(min(wanted, 2.0))
        assert limited[1] * omega >= 0.0


# --- l-l -----------------------------------------------------------------------------------------

LEADERS = (0j, -1.0 + 1.0j)
PLACE = -1.5 - 0.8j
SPEED = 0.6 + 0j


def asked(point: complex, theta: float) -> complex:
    """Demand of l-l on a control point, in the common frame; both leaders move straight ahead."""
    seen = []
    for leader in LEADERS:
        arm, wanted = point - leader, PLACE - leader
        demand = l_phi.l_phi_demand(abs(arm), cmath.phase(arm), abs(wanted), cmath.phase(wanted), 0.6, 0.0, 2.0, 2.0)
        seen.append((abs(arm), *demand, short_way(cmath.phase(arm) - theta)))
    crossing = cmath.phase(PLACE - LEADERS[1]) - cmath.phase(PLACE - LEADERS[0])
    velocity = l_l.l_l_velocity(*seen[0], *seen[1], crossing, 0.15)
    return complex(*velocity) * cmath.exp(1j * theta)


@pytest.mark.parametrize("theta", [0.0, 1.5, -2.5])
@pytest.mark.parametrize("point", [-2.2 - 0.9j, -1.2 - 1.6j, PLACE])
def test_l_l_closes_both_distances_at_alpha(point: complex, theta: float) -> None:
    velocity = asked(point, theta) - SPEED
    for leader in LEADERS:
        arm = point - leader
        rate = (velocity * arm.conjugate()).real / abs(arm)
        assert rate == pytest.approx(-2.0 * (abs(arm) - abs(PLACE - leader)), abs=1e-9)


@pytest.mark.parametrize(("point", "nearer"), [(-2.05 + 2.0j, 1), (1.0 - 1.05j, 0), (1.0 + 0j, 0)])
def test_l_l_in_line_or_on_the_wrong_side_is_l_phi_on_the_nearer(point: complex, nearer: int) -> None:
    arm, wanted = point - LEADERS[nearer], PLACE - LEADERS[nearer]
    turn = cmath.phase(wanted / arm)
    along = complex(-2.0 * (abs(arm) - abs(wanted)), 2.0 * turn * abs(arm))
    assert asked(point, 0.4) == pytest.approx(SPEED + along * arm / abs(arm), abs=1e-9)


@pytest.mark.parametrize("wanted", [1.2, -1.2])
@pytest.mark.parametrize("crossing", [0.1, 0.2, 1.5, 2.9, -0.1, -0.2, -1.5, -2.9])
def test_l_l_asks_for_both_rates_where_the_lines_cross_on_the_wanted_side(crossing: float, wanted: float) -> None:
    gamma_i, gamma_k = 0.4, 0.4 + crossing
    found = complex(*l_l.l_l_velocity(1.0, 0.3, 0.7, gamma_i, 2.0, -0.5, 0.2, gamma_k, wanted, 0.15))
    rates = [(found * cmath.exp(-1j * gamma)).real for gamma in (gamma_i, gamma_k)]
    if math.copysign(1.0, wanted) * math.sin(crossing) < 0.15:  # l-φ on the nearer leader
        assert found == pytest.approx((0.3 + 0.7j) * cmath.exp(1j * gamma_i))
    else:
        assert rates == pytest.approx((0.3, -0.5))


# --- slots ---------------------------------------------------------------------------------------


def test_a_slot_moves_on_a_circle_of_its_own() -> None:
    arm, speed, rate, step = 0.8 - 1.1j, 0.5 + 0.2j, 0.4, 1e-6
    turned = speed * step + arm * cmath.exp(1j * rate * step)
    x, y = slots.slot_velocity(speed.real, speed.imag, rate, arm.real, arm.imag)
    assert complex(x, y) == pytest.approx((turned - arm) / step, abs=1e-5)
    heading = slots.slot_heading(speed.real, speed.imag, rate, arm.real, arm.imag, 9.0)
    assert heading == pytest.approx(cmath.phase(complex(x, y)))
    assert slots.slot_heading(0.0, 1e-3, 0.0, 1.0, 0.0, 0.7) == 0.7
    z = complex(*slots.rotate(1.0, 2.0, math.cos(0.3), math.sin(0.3)))
    assert z == pytest.approx((1 + 2j) * cmath.exp(0.3j))


@PROPERTY
@given(
    st.complex_numbers(min_magnitude=0.01, max_magnitude=10.0),
    st.complex_numbers(max_magnitude=0.99),
    st.floats(0.2, 3.0),
)
def test_the_slot_law_adds_an_approach_along_the_offset(offset: complex, slot: complex, gain: float) -> None:
    def velocity(max_speed: float) -> complex:
        return complex(*slots.slot_law(offset.real, offset.imag, slot.real, slot.imag, gain, max_speed))

    free = slot + gain * offset
    assert velocity(100.0) == pytest.approx(free, abs=1e-9)
    limited = velocity(1.0)
    if abs(free) <= 1.0:
        assert limited == pytest.approx(free, abs=1e-9)
    else:
        share = (limited - slot) / offset
        assert abs(limited) == pytest.approx(1.0)
        assert share.imag == pytest.approx(0.0, abs=1e-9)
        assert -1e-9 <= share.real <= gain


def test_the_slot_law_behind_a_faster_slot_follows_its_direction() -> None:
    velocity = slots.slot_law(0.5, 0.0, 0.0, 2.0, 1.0, 1.0)
    assert complex(*velocity) == pytest.approx(cmath.rect(1.0, math.atan2(2.0, 0.5)))
    assert slots.slot_law(0.0, 0.0, 0.0, 0.0, 1.0, 1.0) == (0.0, 0.0)
