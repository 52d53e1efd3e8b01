"""Which side of an obstacle the wanted velocity is turned to."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.support.minds import Mind, turn
from tests.support.plain import plain

detour, safeguard = plain("ddcs.tracking.detour"), plain("laws.safeguard")


def past(m: Mind, velocity: complex, *obstacles: tuple[complex, float], speed: float = 0.0) -> complex:
    discs = np.zeros(16, safeguard.DISC)
    for k, (at, reach) in enumerate(obstacles):
        safeguard.put_disc(discs, k, at.real, at.imag, 0.0, speed, reach, 0.1)
    return complex(*detour.way_past(m.f, m.s, m.d, discs, len(obstacles), velocity.real, velocity.imag))


def tangent(at: complex, reach: float, side: float) -> float:
    return math.atan2(at.imag, at.real) + side * math.asin((reach + 0.2) / abs(at))


@pytest.fixture
def m() -> Mind:
    mind = Mind(played={"detour": 0.2})
    mind.d.step, mind.d.side_step = 100, 10
    return mind


@pytest.mark.parametrize("heading", [0.0, 2.5])
@pytest.mark.parametrize(("y", "side"), [(0.1, -1), (-0.1, 1)])
def test_the_way_is_the_shorter_tangent(m: Mind, y: float, side: int, heading: float) -> None:
    at = 1.5 + 1j * y
    angle = heading + tangent(at, 0.5, side)
    found = past(m, 0.7 * turn(heading), (at * turn(heading), 0.5))
    assert found == pytest.approx(0.7 * turn(angle))
    assert (m.d.side, m.d.side_step) == (side, 100)


def test_a_side_is_kept_for_a_while(m: Mind) -> None:
    at = 1.5 + 0.1j
    for kept, ago, side in ((1, 14, 1), (1, 16, -1), (-1, 14, -1), (1, 90, -1)):
        m.d.side, m.d.side_step = kept, 100 - ago
        assert past(m, 1 + 0j, (at, 0.5)) == pytest.approx(turn(tangent(at, 0.5, side)))
        assert m.d.side == side
    m.d.side, m.d.side_step = -1, 99
    at = 1.5 - 0.1j
    assert past(m, 1 + 0j, (at, 0.5)) == pytest.approx(turn(tangent(at, 0.5, -1)))
    m.f.dt = 0.5
    for ago, side in ((3, -1), (4, 1)):  # up to 1.5 s
        m.d.side, m.d.side_step = -1, 100 - ago
        assert past(m, 1 + 0j, (at, 0.5)) == pytest.approx(turn(tangent(at, 0.5, side)))


def test_where_one_side_is_shut_the_other_is_taken(m: Mind) -> None:
    arc = [(1.2 * turn(a), 0.4) for a in np.arange(-0.1, 2.6, 0.5)]
    first, _ = arc[0]
    m.d.side, m.d.side_step = 1, 99
    assert past(m, 1 + 0j, *arc) == pytest.approx(turn(tangent(first, 0.4, -1)))
    ring = [(1.2 * turn(a), 0.4) for a in np.arange(0.0, 2 * math.pi, 0.5)]
    assert past(m, 1 + 0.5j, *ring) == 1 + 0.5j


def test_what_is_free_is_left_alone(m: Mind) -> None:
    for velocity in (1 + 0j, 1e-7 + 0j):
        assert past(m, velocity, (-1 + 0j, 0.5)) == velocity
        assert past(m, velocity, (1 + 0.8j, 0.5)) == velocity
    assert past(m, 1e-7 + 0j, (1 + 0j, 0.5)) == 1e-7
    assert past(m, 1 + 0j, (1 + 0j, 0.5), speed=0.1) == 1
    assert past(m, 1 + 0j, (5 + 0j, 2.5)) == 1  # as large as that is a wall
    assert (m.d.side, m.d.side_step) == (0, 10)
    assert past(m, 1 + 0j, (5 + 0j, 2.0)) != 1
    assert (abs(m.d.side), m.d.side_step) == (1, 100)


def test_what_is_near_has_its_tangents_too(m: Mind) -> None:
    at = 0.9 - 0.1j
    assert past(m, 1 + 0j, (at, 0.5)) == pytest.approx(turn(tangent(at, 0.5, 1)))


def test_a_disc_blocks_the_way_within_its_reach_and_the_clearance() -> None:
    discs = np.zeros(1, safeguard.DISC)
    for x, y, blocked in ((1.0, 0.68, True), (1.0, -0.68, True), (1.0, 0.69, False), (-1.0, 0.0, False)):
        safeguard.put_disc(discs, 0, x, y, 0.0, 0.0, 0.5, 0.1)
        assert detour.blocks(discs[0], 0.2, 1.0, 0.0) == blocked
    safeguard.put_disc(discs, 0, 1.0, 0.0, 0.1, 0.0, 0.5, 0.1)
    assert not detour.blocks(discs[0], 0.2, 1.0, 0.0)


@pytest.mark.parametrize("heading", [0.0, 2.5])
def test_a_row_of_five_is_passed_and_a_longer_one_has_no_way(heading: float) -> None:
    facing = turn(heading)
    row = [((1.2 + 0.1 * k) * turn(0.3 * k), 0.4) for k in range(6)]
    discs = np.zeros(6, safeguard.DISC)

    def past_row(count: int, side: float, way: complex = facing) -> float:
        return float(detour.turn_past(discs, count, 0.2, way.real, way.imag, side))

    for side in (1, -1):
        for k, (at, reach) in enumerate(row):
            at = (at if side == 1 else at.conjugate()) * facing
            safeguard.put_disc(discs, k, at.real, at.imag, 0.0, 0.0, reach, 0.1)
        found = [past_row(count, side) for count in (1, 2, 5, 6)]
        ends = [tangent(*row[k], 1) for k in (0, 1, 4)]
        assert found == pytest.approx([*(side * end for end in ends), 4.0])
    assert past_row(6, -1, -facing) == 0.0
    # An edge more than 2 rad to the side is no way past.
    discs[0].x, discs[0].y = 0.5 * math.cos(heading + 1.2), 0.5 * math.sin(heading + 1.2)
    assert past_row(1, 1) == 4.0
