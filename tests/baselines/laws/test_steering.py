"""Intercept times, and velocities towards a slot."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from posse_baselines.laws.steering import NEVER, approach_velocity, intercept_time, way_round

PROPERTY = settings(derandomize=True, database=None, deadline=None, max_examples=100)
PLACES = st.floats(-20.0, 20.0)
SPEEDS = st.floats(-0.6, 0.6)


@PROPERTY
@given(PLACES, PLACES, SPEEDS, SPEEDS)
def test_the_point_is_as_far_away_as_the_robot_gets_in_that_time(x: float, y: float, vx: float, vy: float) -> None:
    t = intercept_time(x, y, vx, vy, 1.0)
    assert t >= 0.0
    assert math.isclose(math.hypot(x + vx * t, y + vy * t), t, rel_tol=1e-6, abs_tol=1e-6)


@PROPERTY
@given(st.floats(0.1, 20.0), SPEEDS, SPEEDS, st.floats(0.9, 1.5))
def test_a_point_is_met_at_the_first_root(away: float, vx: float, vy: float, top: float) -> None:
    assume(math.hypot(vx, vy) < top - 0.01)
    roots = np.roots([vx**2 + vy**2 - top**2, 2 * away * vx, away**2])  # |p + v t| = top t
    earliest = min(root.real for root in roots if root.real >= 0)
    assert intercept_time(away, 0.0, vx, vy, top) == pytest.approx(earliest, rel=1e-6, abs=1e-9)


def test_a_point_that_gets_away_is_never_met() -> None:
    assert intercept_time(1.0, 0.0, 1.2, 0.0, 1.0) == NEVER
    assert intercept_time(2.0, 0.0, -1.0, 0.0, 1.0) == 1.0
    # As fast as the robot: it is met if it comes nearer.
    assert intercept_time(3.0, 4.0, -0.6, -0.8, 1.0) == pytest.approx(2.5)
    assert intercept_time(3.0, 4.0, -0.8, 0.6, 1.0) == NEVER
    assert intercept_time(3.0, 4.0, 0.6, 0.8, 1.0) == NEVER


@PROPERTY
@given(st.floats(0.05, 10.0), st.floats(0.2, 4.0))
def test_an_approach_leaves_room_to_brake(distance: float, deceleration: float) -> None:
    speed, aside = approach_velocity(distance, 0.0, 0.0, 0.0, 2.0, 1.0, deceleration)
    assert aside == 0.0
    assert 0.0 < speed <= 1.0
    assert speed**2 / (2.0 * deceleration) <= distance


@PROPERTY
@given(st.floats(-math.pi, math.pi), st.floats(1.0, 6.0), st.floats(-math.pi, math.pi))
def test_the_way_round_keeps_clear_and_arrives(start: float, away: float, end: float) -> None:
    clearance = 0.75
    x, y = away * math.cos(start), away * math.sin(start)
    to = (1.2 * math.cos(end), 1.2 * math.sin(end))
    least = away
    for _ in range(4000):
        wx, wy = way_round(x, y, *to, clearance)
        left = math.hypot(wx - x, wy - y)
        x, y = x + 0.01 * (wx - x) / max(left, 0.01), y + 0.01 * (wy - y) / max(left, 0.01)
        least = min(least, math.hypot(x, y))
    assert math.dist((x, y), to) < 0.02
    assert least > 0.82 * clearance  # the cosine of the least turn


@pytest.mark.parametrize("heading", [0.0, 2.0])
@pytest.mark.parametrize("side", [1, -1])
def test_the_way_round_begins_along_a_tangent(heading: float, side: int) -> None:
    turn = cmath.rect(1.0, heading)
    start, end = (-2 + 0.3j * side) * turn, (3 + 0.1j * side) * turn
    point = complex(*way_round(start.real, start.imag, end.real, end.imag, 0.8))
    assert abs(point) == pytest.approx(0.8)
    assert (point / (start - point)).real == pytest.approx(0.0, abs=1e-9)
    assert (point / turn).imag * side > 0


def test_a_way_that_is_clear_is_left_alone() -> None:
    assert way_round(-3.0, 1.0, 3.0, 1.0, 0.75) == (3.0, 1.0)
    assert way_round(-3.0, 0.0, -1.2, 0.0, 0.75) == (-1.2, 0.0)
    assert way_round(-3.0, 0.1, 3.0, 0.1, 0.75)[1] > 0.0  # round the side that is nearer
