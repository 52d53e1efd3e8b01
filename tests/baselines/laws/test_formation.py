"""l-φ and l-l: demands on a follower, recomputed from the rates that they promise."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from posse_baselines.laws import formation
from posse_baselines.laws.formation import Demand, Polar
from posse_baselines.laws.guidance import BODY

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
    demand = formation.l_phi_demand(Polar(l_now, phi), Polar(l_d, phi_d), leader_speed, leader_omega, 2.0, 1.5)
    point = formation.point_velocity(Demand(l_now, demand, gamma))  # in the follower's own axes
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
    speed, omega = formation.held_command(complex(ahead, across), OFFSET, dt)
    half = omega * dt / 2
    chord = speed * dt * (math.sin(half) / half if half else 1.0)
    point = cmath.rect(chord, half) + cmath.rect(OFFSET, omega * dt)
    assert point == pytest.approx(OFFSET + dt * complex(ahead, across), abs=1e-9)


def test_for_a_short_step_the_held_command_is_the_paper_s() -> None:
    speed, omega = formation.held_command(0.7 + 0.3j, OFFSET, 1e-6)
    assert (speed, omega) == pytest.approx((0.7, 0.3 / OFFSET), rel=1e-4)


def test_the_sampled_rate_leaves_what_an_exponential_leaves() -> None:
    for alpha, dt in ((2.0, 0.1), (0.5, 0.02)):
        left = 1.0 - dt * formation.sampled_rate(alpha, dt)
        assert left == pytest.approx(math.exp(-alpha * dt))


@PROPERTY
@given(st.floats(-5.0, 5.0), st.floats(-20.0, 20.0))
def test_limits_hold_and_reversing_becomes_a_turn(speed: float, omega: float) -> None:
    body = np.zeros(1, BODY)[0]
    body["max_speed"], body["max_omega"] = 1.0, 2.0
    limited = formation.limit_command(body, speed, omega, OFFSET)
    if speed >= 0.0:
        assert limited == pytest.approx((np.clip(speed, 0, 1), np.clip(omega, -2, 2)))
    else:
        wanted = math.hypot(speed, omega * OFFSET) / OFFSET
        assert limited[0] == 0.0
        assert abs(limited[1]) == pytest.approx(min(wanted, 2.0))
        assert limited[1] * omega >= 0.0


# --- l-l -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("wanted", [1.2, -1.2])
@pytest.mark.parametrize("crossing", [0.1, 0.2, 1.5, 2.9, -0.1, -0.2, -1.5, -2.9])
def test_l_l_asks_for_both_rates_where_the_lines_cross_on_the_wanted_side(crossing: float, wanted: float) -> None:
    gamma_i, gamma_k = 0.4, 0.4 + crossing
    found = formation.l_l_velocity(Demand(1.0, 0.3 + 0.7j, gamma_i), Demand(2.0, -0.5 + 0.2j, gamma_k), wanted, 0.15)
    rates = [(found * cmath.exp(-1j * gamma)).real for gamma in (gamma_i, gamma_k)]
    if math.copysign(1.0, wanted) * math.sin(crossing) < 0.15:  # l-φ on the nearer leader
        assert found == pytest.approx((0.3 + 0.7j) * cmath.exp(1j * gamma_i))
    else:
        assert rates == pytest.approx((0.3, -0.5))
