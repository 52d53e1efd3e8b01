"""Assignment of slots, and velocities towards a slot."""

import cmath
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from posse_baselines.laws.steering import WORK_ROWS, approach_velocity, assign, slot_heading, slot_velocity, way_round


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
