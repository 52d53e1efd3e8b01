"""The safeguard: robots avoid collisions within their limits."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from posse_baselines.laws.heading import BODY, regulate
from posse_baselines.laws.safeguard import DISC, PLAYS, put_disc, put_wall, safe_velocity

DT = 0.1
WORK = np.zeros(1, PLAYS)[0]
LIMITS = [(1e4, 1e4), (1.0, 4.0)]  # acceleration, turn acceleration


def body_of(theta: float, speed: float, limits: tuple[float, float]) -> Any:
    bodies = np.zeros(1, BODY)
    body = bodies[0]
    body.heading_cos, body.heading_sin = math.cos(theta), math.sin(theta)
    body.speed, body.omega = speed, 0.0
    body.max_speed, body.max_omega, body.dt = 1.0, 2.0, DT
    body.acceleration, body.turn_acceleration = limits
    return body


def drive(body: Any, x: float, y: float, wanted: tuple[float, float]) -> tuple[float, float]:
    """Move a body for one control step in short steps; return the new position."""
    speed, omega = regulate(body, *wanted, 0.0)
    for _ in range(10):
        dv, dw = body.acceleration * DT / 10, body.turn_acceleration * DT / 10
        body.speed = min(max(speed, body.speed - dv), body.speed + dv)
        body.omega = min(max(omega, body.omega - dw), body.omega + dw)
        theta = math.atan2(body.heading_sin, body.heading_cos) + body.omega * DT / 10
        body.heading_cos, body.heading_sin = math.cos(theta), math.sin(theta)
        x += body.speed * body.heading_cos * DT / 10
        y += body.speed * body.heading_sin * DT / 10
    return x, y


@pytest.mark.parametrize("limits", LIMITS)
@pytest.mark.parametrize("offset", [-0.5, -0.1, 0.0, 0.1, 0.5])
@pytest.mark.parametrize("radius", [0.15, 0.4, 0.8])
def test_a_resting_disc_ahead_is_gone_round(limits: tuple[float, float], offset: float, radius: float) -> None:
    body, x, y = body_of(0.0, 1.0, limits), -4.0, 0.0
    discs, reach, least = np.zeros(4, DISC), radius + 0.15, math.inf
    for _ in range(120):
        count = put_disc(discs, 0, -x, offset - y, 0.0, 0.0, reach, 0.15)
        goal = math.atan2(-y, 4.0 - x)
        vx, vy, _ = safe_velocity(body, discs, count, math.cos(goal), math.sin(goal), WORK)
        x, y = drive(body, x, y, (vx, vy))
        least = min(least, math.hypot(x, offset - y) - reach)
        if x > 3.0:
            break
    assert least > 0.0
    assert x > 3.0


@pytest.mark.parametrize("limits", LIMITS)
def test_two_that_meet_head_on_pass_each_other(limits: tuple[float, float]) -> None:
    pair = [body_of(0.0, 1.0, limits), body_of(math.pi, 1.0, limits)]
    places = [(-3.0, 0.0), (3.0, 0.0)]
    goals = [3.0, -3.0]
    discs, least = np.zeros(4, DISC), math.inf
    for _ in range(120):
        wanted = []
        for i in (0, 1):
            (x, y), (ox, oy), other = places[i], places[1 - i], pair[1 - i]
            vx, vy = other.speed * other.heading_cos, other.speed * other.heading_sin
            count = put_disc(discs, 0, ox - x, oy - y, vx, vy, 0.3, 0.15)
            goal = math.atan2(-y, goals[i] - x)
            ux, uy, _ = safe_velocity(pair[i], discs, count, math.cos(goal), math.sin(goal), WORK)
            wanted.append((ux, uy))
        places = [drive(pair[i], *places[i], wanted[i]) for i in (0, 1)]
        least = min(least, math.dist(*places) - 0.3)
        if places[0][0] > 2.0 and places[1][0] < -2.0:
            break
    assert least > 0.0
    assert places[0][0] > 2.0
    assert places[1][0] < -2.0


@pytest.mark.parametrize("limits", LIMITS)
def test_a_resting_robot_gives_way_to_what_comes_at_it(limits: tuple[float, float]) -> None:
    body, x, y = body_of(1.0, 0.0, limits), 0.0, 0.0
    discs, least = np.zeros(4, DISC), math.inf
    for k in range(80):
        comes = -4.0 + 0.6 * k * DT
        count = put_disc(discs, 0, comes - x, -y, 0.6, 0.0, 0.3, 0.2)
        vx, vy, _ = safe_velocity(body, discs, count, 0.0, 0.0, WORK)
        x, y = drive(body, x, y, (vx, vy))
        least = min(least, math.hypot(comes + 0.06 - x, y) - 0.3)
    assert least > 0.0


@pytest.mark.parametrize("limits", LIMITS)
def test_a_wall_stops_a_robot_that_presses_on(limits: tuple[float, float]) -> None:
    body, x, y = body_of(0.3, 1.0, limits), 0.0, 0.0
    discs, nearest = np.zeros(4, DISC), math.inf
    for _ in range(80):
        count = put_wall(discs, 0, 3.0 - x, 1.0, 0.0, 0.15, 0.15)
        vx, vy, _ = safe_velocity(body, discs, count, 1.0, 0.0, WORK)
        x, y = drive(body, x, y, (vx, vy))
        nearest = min(nearest, 3.0 - 0.15 - x)
    assert 0.0 < nearest < 0.6


def test_a_wanted_velocity_that_is_safe_is_left_alone() -> None:
    discs = np.zeros(4, DISC)
    count = put_disc(discs, 0, -1.0, 0.0, 0.0, 0.0, 0.3, 0.15)
    assert safe_velocity(body_of(0.0, 1.0, LIMITS[1]), discs, count, 1.0, 0.0, WORK) == (1.0, 0.0, False)


def choose(speed: float, wanted: complex, *discs: tuple[complex, complex, float, float]) -> tuple[complex, bool]:
    """Choose for a robot that looks along x; a disc is (place, velocity, reach, margin)."""
    found, count = np.zeros(8, DISC), 0
    for at, velocity, reach, margin in discs:
        count = put_disc(found, count, at.real, at.imag, velocity.real, velocity.imag, reach, margin)
    body = body_of(0.0, speed, (1.5, 5.0))
    x, y, changed = safe_velocity(body, found, count, wanted.real, wanted.imag, WORK)
    return complex(x, y), changed


@pytest.mark.parametrize("ahead", [0.7, 0.8, 0.9])
def test_what_is_straight_ahead_is_passed_on_the_right(ahead: float) -> None:
    velocity, changed = choose(0.6, 0.8 + 0j, (ahead + 0j, -0.3 + 0j, 0.3, 0.2))
    assert changed
    assert velocity.imag < -0.1


def test_a_robot_that_can_only_stop_stops() -> None:
    places = (0.53, 0.1 + 0.33j, 0.1 - 0.33j, -0.3 + 0.3j, -0.3 - 0.3j)
    assert choose(0.6, 0.8 + 0j, *((complex(at), 0j, 0.3, 0.02) for at in places)) == (0j, True)


def test_in_contact_no_velocity_is_better_than_the_wanted_one() -> None:
    assert choose(0.6, 0.7 + 0.1j, (0.1 + 0j, 0j, 0.5, 0.2)) == (0.7 + 0.1j, True)


def test_a_full_list_of_discs_stays_as_it_is() -> None:
    discs = np.zeros(1, DISC)
    count = put_disc(discs, 0, 1.0, 2.0, 0.0, 0.0, 0.3, 0.1)
    assert put_disc(discs, count, 5.0, 5.0, 0.0, 0.0, 0.3, 0.1) == 1
    assert discs[0].x == 1.0
