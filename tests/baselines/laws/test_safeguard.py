"""The safeguard: robots avoid collisions within their limits."""

import cmath
import math
from typing import Any

import numpy as np
import pytest
from tests.baselines.laws.test_guidance import body_of

from posse import get_scenario
from posse_baselines.ddcs import Settings
from posse_baselines.ddcs.memory import constants_of
from posse_baselines.laws.guidance import regulate
from posse_baselines.laws.safeguard import DISC, put_disc, put_walls, safe_velocity

DT = 0.1
Disc = tuple[complex, complex, float, float]
"""Place, velocity, reach, margin."""
LIMITS = pytest.mark.parametrize("limits", [(1e4, 1e4), (1.0, 4.0)])  # acceleration, turn acceleration


def safe(body: Any, wanted: complex, *discs: Disc) -> tuple[complex, bool]:
    found, count = np.zeros(8, DISC), 0
    for disc in discs:
        count = put_disc(found, count, *disc)
    return safe_velocity(body, found[:count], wanted)


def drive(body: Any, place: complex, wanted: complex) -> complex:
    """Move a body for one control step in short steps; return the new position."""
    speed, omega = regulate(body, wanted, 0.0)
    for _ in range(10):
        dv, dw = body.acceleration * DT / 10, body.turn_acceleration * DT / 10
        body.speed = min(max(speed, body.speed - dv), body.speed + dv)
        body.omega = min(max(omega, body.omega - dw), body.omega + dw)
        body.heading *= cmath.rect(1.0, body.omega * DT / 10)
        place += body.speed * body.heading * DT / 10
    return place


def towards(place: complex, goal: complex) -> complex:
    return cmath.rect(1.0, cmath.phase(goal - place))


@LIMITS
@pytest.mark.parametrize("offset", [-0.5, -0.1, 0.0, 0.1, 0.5])
@pytest.mark.parametrize("radius", [0.15, 0.8])
def test_a_resting_disc_ahead_is_passed(limits: tuple[float, float], offset: float, radius: float) -> None:
    body, place, reach = body_of(0.0, 1.0, limits), -4 + 0j, radius + 0.15
    for _ in range(120):
        velocity, _ = safe(body, towards(place, 4 + 0j), (1j * offset - place, 0j, reach, 0.15))
        place = drive(body, place, velocity)
        assert abs(place - 1j * offset) > reach
    assert place.real > 3.0


@LIMITS
def test_two_that_meet_head_on_pass_each_other(limits: tuple[float, float]) -> None:
    pair = [body_of(0.0, 1.0, limits), body_of(math.pi, 1.0, limits)]
    places, goals = [-3 + 0j, 3 + 0j], [3 + 0j, -3 + 0j]
    for _ in range(100):
        wanted = []
        for i, other in ((0, pair[1]), (1, pair[0])):
            disc = (places[1 - i] - places[i], other.speed * other.heading, 0.3, 0.15)
            wanted.append(safe(pair[i], towards(places[i], goals[i]), disc)[0])
        places = [drive(pair[i], places[i], wanted[i]) for i in (0, 1)]
        assert abs(places[0] - places[1]) > 0.3
        if places[0].real > 2.0 > -2.0 > places[1].real:
            break
    assert places[0].real > 2.0
    assert places[1].real < -2.0


@LIMITS
def test_a_resting_robot_gives_way_to_what_comes_at_it(limits: tuple[float, float]) -> None:
    body, place = body_of(1.0, 0.0, limits), 0j
    for k in range(80):
        comes = -4.0 + 0.6 * k * DT
        velocity, _ = safe(body, 0j, (comes - place, 0.6 + 0j, 0.3, 0.2))
        place = drive(body, place, velocity)
        assert abs(comes + 0.06 - place) > 0.3


@pytest.mark.parametrize("turn", [1.5, 0.0, -1.5])
def test_a_disc_that_turns_is_avoided_where_its_arc_leads(turn: float) -> None:
    """A quarter of a circle of 0.53 m leads to the robot; straight on it is passed, and more so on the other circle."""
    disc, radius = np.zeros(1, DISC), 0.8 / 1.5
    put_disc(disc, 0, complex(-radius, radius), -0.8j, 0.3, 0.15)
    disc["turn"] = turn
    _, changed = safe_velocity(body_of(1.0, 0.0, (1.0, 4.0)), disc, 0j)
    assert changed == (turn > 0.0)


@LIMITS
def test_a_wall_stops_a_robot_that_presses_on(limits: tuple[float, float]) -> None:
    body, place, nearest, discs = body_of(0.3, 1.0, limits), 0j, math.inf, np.zeros(4, DISC)
    room = constants_of(get_scenario("search", arena=(6.0, 12.0)), Settings())[0]
    for _ in range(80):
        count = put_walls(discs, 0, room, place, 0.15, 0.15)
        velocity, _ = safe_velocity(body, discs[:count], 1 + 0j)
        place = drive(body, place, velocity)
        nearest = min(nearest, 3.0 - 0.15 - place.real)
    assert 0.0 < nearest < 0.6


def test_a_wanted_velocity_that_is_safe_is_left_alone() -> None:
    assert safe(body_of(0.0, 1.0, (1.0, 4.0)), 1 + 0j, (-1 + 0j, 0j, 0.3, 0.15)) == (1 + 0j, False)


UNDER_WAY = (0.0, 0.6, (1.5, 5.0))


@pytest.mark.parametrize("ahead", [0.7, 0.8, 0.9])
def test_what_is_straight_ahead_is_passed_on_the_right(ahead: float) -> None:
    velocity, changed = safe(body_of(*UNDER_WAY), 0.8 + 0j, (ahead + 0j, -0.3 + 0j, 0.3, 0.2))
    assert changed
    assert velocity.imag < -0.1


def test_a_robot_that_can_only_stop_stops() -> None:
    places = (0.53 + 0j, 0.1 + 0.33j, 0.1 - 0.33j, -0.3 + 0.3j, -0.3 - 0.3j)
    assert safe(body_of(*UNDER_WAY), 0.8 + 0j, *((place, 0j, 0.3, 0.02) for place in places)) == (0j, True)


def test_in_contact_no_velocity_is_better_than_the_wanted_one() -> None:
    assert safe(body_of(*UNDER_WAY), 0.7 + 0.1j, (0.1 + 0j, 0j, 0.5, 0.2)) == (0.7 + 0.1j, True)
