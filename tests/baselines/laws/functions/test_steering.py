"""Intercepts and approaches, solved anew."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from tests.support.minds import layout_of
from tests.support.plain import plain

from posse.scenarios.limits import OPEN_PLANE_EXTENT

steering, slots = plain("laws.steering"), plain("laws.slots")
NEVER = 1e6


def earliest(p: complex, v: complex, top: float) -> float:
    """The least t >= 0 at which |p + v t| = top t."""
    roots = np.roots([abs(v) ** 2 - top**2, 2 * (p * v.conjugate()).real, abs(p) ** 2])
    real = [r.real for r in roots if abs(r.imag) < 1e-12 and r.real >= 0]
    return float(min(real, default=NEVER))


@pytest.mark.parametrize("seed", range(30))
def test_a_point_is_met_at_the_first_root(seed: int) -> None:
    rng = np.random.default_rng(seed)
    p, v = complex(*rng.normal(0, 4, 2)), complex(*rng.normal(0, 0.4, 2))
    top = float(rng.uniform(0.9, 1.5))
    if abs(v) < top:
        found = steering.intercept_time(p.real, p.imag, v.real, v.imag, top)
        assert found == pytest.approx(earliest(p, v, top))


def test_a_point_as_fast_as_the_robot_is_met_if_it_comes() -> None:
    assert steering.intercept_time(3.0, 4.0, -0.6, -0.8, 1.0) == pytest.approx(2.5)
    assert steering.intercept_time(3.0, 4.0, -0.8, 0.6, 1.0) == NEVER
    assert steering.intercept_time(3.0, 4.0, 0.6, 0.8, 1.0) == NEVER
    assert steering.intercept_time(0.3, 0.4, 0.6, 0.8, 1.0) == NEVER
    assert steering.intercept_time(0.3, 0.4, -0.6, -0.8, 1.0) == pytest.approx(0.25)
    assert steering.intercept_time(3.0, 0.0, 0.0, 1.0, 1.0) == NEVER
    assert steering.intercept_time(1e4, 0.0, -1e-4, 1.0, 1.0) == NEVER
    assert steering.intercept_time(0.0, 0.0, 0.5, 0.0, 1.0) == 0.0
    assert steering.intercept_time(1e7, 0.0, 0.5, 0.0, 1.0) == NEVER


def test_a_far_slot_is_met_with_the_mean_velocity() -> None:
    def time(x: float, y: float = 1.0) -> float:
        return float(steering.time_to_slot(x, y, 0.5, 0.1, -0.2, 0.3, 1.5, 1.0))

    assert time(0.3, 0.4) == pytest.approx(earliest(0.3 + 0.4j, 0.5 + 0.1j, 1.0))
    assert time(5.0) == pytest.approx(earliest(5 + 1j, -0.2 + 0.3j, 1.0))


@pytest.mark.parametrize("offset", [0.02 + 0.01j, 1 - 2j, -4 + 3j, 0j])
@pytest.mark.parametrize("deceleration", [0.3, 50.0])
def test_an_approach_is_slow_enough_to_brake(offset: complex, deceleration: float) -> None:
    gain = 3.0
    if offset:
        gain = min(3.0, math.sqrt(1.6 * deceleration / abs(offset)))
    found = steering.approach_velocity(offset.real, offset.imag, 0.2, -0.1, 3.0, 0.9, deceleration)
    wanted = slots.slot_law(offset.real, offset.imag, 0.2, -0.1, gain, 0.9)
    assert found == pytest.approx(wanted)


@pytest.mark.parametrize("seed", range(20))
def test_the_slot_law_goes_straight_for_an_intercept(seed: int) -> None:
    rng = np.random.default_rng(seed)
    offset, slot = complex(*rng.normal(0, 2, 2)), complex(*rng.normal(0, 0.3, 2))
    gain, top = rng.uniform(0.3, 3), rng.uniform(0.8, 1.2)
    found = complex(*slots.slot_law(offset.real, offset.imag, slot.real, slot.imag, gain, top))
    wanted = slot + gain * offset
    if abs(wanted) > top:
        wanted = slot + offset / earliest(offset, slot, top)
    assert found == pytest.approx(wanted)
    fast = complex(*slots.slot_law(offset.real, offset.imag, 3.0, 4.0, 0.1, top))
    away = 3 + 4j + 0.1 * offset
    assert fast == pytest.approx(top * away / abs(away))
    level = complex(*slots.slot_law(0.0, 1.0, 1.0, 0.0, 0.5, 1.0))
    assert level == pytest.approx(1.0)  # as fast as the robot: its course, no nearer
    faster = complex(*slots.slot_law(0.0, 1.0, 1.2, 0.0, 0.5, 1.0))
    assert faster == pytest.approx((1.2 + 0.5j) / 1.3)
    tiny = complex(*slots.slot_law(4e-4, 0.0, 0.1, 0.0, 1.0, top))
    assert tiny == pytest.approx(0.1 + 4e-4 * 0.4)  # a distance counts as 1 mm, at least


@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_the_way_round_leads_by_the_tangent_point(heading: float) -> None:
    turn = cmath.exp(1j * heading)

    def way(start: complex, end: complex, clearance: float = 0.8) -> complex:
        a, b = start * turn, end * turn
        return complex(*steering.way_round(a.real, a.imag, b.real, b.imag, clearance)) / turn

    for side in (1, -1):
        start, end = -2 + 0.3j * side, 3 + 0.1j * side
        found = way(start, end)
        assert abs(found) == pytest.approx(0.8)
        assert (found / (start - found)).real == pytest.approx(0.0, abs=1e-12)  # a tangent
        assert found.imag * side > 0
    assert way(-2 + 0.9j, 3 + 0.85j) == pytest.approx(3 + 0.85j)
    assert way(-2 + 0.1j, -0.5 + 0.1j) == pytest.approx(-0.5 + 0.1j)  # short of the middle
    assert way(-2 + 0.1j, -3 + 0.1j) == pytest.approx(-3 + 0.1j)
    assert way(0.5 + 0.1j, 1.2 + 0.1j) == pytest.approx(1.2 + 0.1j)  # away from the middle
    short = way(-0.81 - 0.01j, 0.3 + 0j)
    assert short == pytest.approx(0.8 * cmath.rect(1.0, cmath.phase(-0.81 - 0.01j) + 0.6))
    inside = way(-0.5 + 0.1j, 3 + 0j)
    assert inside == pytest.approx(0.8 * cmath.rect(1.0, cmath.phase(-0.5 + 0.1j) - 0.6))
    assert way(-0.81 - 0.01j, 3 + 0j) == pytest.approx(0.8 * cmath.rect(1.0, cmath.phase(-0.81 - 0.01j) + 0.6))


@pytest.mark.parametrize("place", [-6 + 0.4j, 1.0 + 0.5j, -1.25 - 1j, -30 + 5j])
def test_a_course_to_a_slot_blends_present_and_mean_velocity(place: complex) -> None:
    arm, velocity, mean, rate, weave = 1.2 - 0.9j, 0.5 + 0.1j, 0.1 - 0.2j, 0.2, 1.5
    found = steering.meeting_velocity(
        place.real,
        place.imag,
        arm.real,
        arm.imag,
        velocity.real,
        velocity.imag,
        mean.real,
        mean.imag,
        rate,
        weave,
        0.7,
        1e6,
        1.0,
        1e4,
    )
    way = complex(*steering.way_round(place.real, place.imag, arm.real, arm.imag, 0.7)) - place
    time = min(20.0, earliest(way, velocity, 1.0))
    share = weave * (1.0 - math.exp(-time / weave)) / time if time > 0.1 else 1.0
    slot = share * (velocity + 1j * rate * arm) + (1.0 - share) * mean
    gain = min(1e6, math.sqrt(1.6 * 1e4 / abs(way)))
    wanted = slots.slot_law(way.real, way.imag, slot.real, slot.imag, gain, 1.0)
    assert found == pytest.approx(wanted)


def test_a_slot_in_reach_moves_as_it_does_now() -> None:
    found = steering.meeting_velocity(1.19, -0.9, 1.2, -0.9, 0.5, 0.1, -0.4, 0.0, 0.2, 1.5, 0.0, 0.5, 1.0, 1e4)
    assert found == pytest.approx((0.5 + 0.2 * 0.9 + 0.5 * 0.01, 0.1 + 0.2 * 1.2))
    found = steering.meeting_velocity(0.8, -0.9, 1.2, -0.9, -0.6, 0.1, 0.4, 0.0, 0.0, 1.5, 0.0, 0.1, 1.0, 1e4)
    time = earliest(0.4 + 0j, -0.6 + 0.1j, 1.0)
    share = 1.5 * (1.0 - math.exp(-time / 1.5)) / time
    assert found == pytest.approx((share * -0.6 + (1 - share) * 0.4 + 0.04, share * 0.1))


def test_an_action_has_speed_from_minus_one_and_turn_rate_from_its_limit() -> None:
    action = np.zeros(4)
    for speed, omega, wanted in (
        (0.0, 0.0, (-1, 0)),
        (0.6, 1.0, (0.5, 0.5)),
        (0.8, -2.0, (1, -1)),
        (9, 9, (1, 1)),
        (-1, -9, (-1, -1)),
    ):
        steering.write_motion(action, speed, omega, 0.8, 2.0)
        assert tuple(action) == pytest.approx((*wanted, 0, 0))


@pytest.mark.parametrize("name", ["field", "constant", "search"])
def test_offsets_are_those_of_the_layout(name: str) -> None:
    layout = layout_of(name)
    record, s = plain("laws.offsets").offsets_of(layout), layout.scenario
    assert record.shape == (1,)
    f = record[0]
    for field, at in layout.offsets.items():
        if field in (f.dtype.names or ()) and field not in ("sonar_range",):
            assert f[field] == at
    assert (f.neighbours, f.stride) == (layout.neighbours, layout.stride)
    assert (f.sonar_beams, f.message_size) == (s.sonar_beams, 5)
    assert (f.dt, f.radius, f.extent) == pytest.approx((s.control_step, s.robot_radius, s.position_bound))
    assert f.sonar_range == pytest.approx(s.sonar_range)
    assert f.wide_beam == pytest.approx(math.cos(1.2 * math.pi / 8))
    assert f.sight == pytest.approx(min(s.sensing_range, 8.0))
    walled = math.isfinite(s.arena)
    assert f.walled == walled
    assert f.area == pytest.approx(s.arena / 2 if walled else 1.4 * OPEN_PLANE_EXTENT)
    few = layout_of(name, sonar_beams=0, message_size=0, num_neighbours=0)
    f = plain("laws.offsets").offsets_of(few)[0]
    assert (f.sonar, f.neighbour_message) == (-1, -1)
    assert f.wide_beam == pytest.approx(math.cos(1.2 * math.pi))
