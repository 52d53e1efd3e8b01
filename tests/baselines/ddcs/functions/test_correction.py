"""Corrections of the wanted velocity."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.minds import Mind, turn
from tests.support.plain import plain

correction, controller, heading = (plain("ddcs.correction"), plain("ddcs.controller"), plain("laws.heading"))


def wishing(wish: complex, theta: float) -> tuple[Mind, object]:
    m = Mind()
    m.d.wish_x, m.d.wish_y, m.d.wish_speed, m.d.wish_omega = wish.real, wish.imag, 0.3, 0.2
    return m, m.body(0j, theta, max_speed=0.8)


def test_a_proposal_is_the_wanted_velocity_in_the_robot_s_frame() -> None:
    m, body = wishing(0.5 - 0.2j, 2.0)
    proposal = np.zeros(2, np.float32)
    correction.write_proposal(m.d, body, proposal)
    assert complex(*proposal) == pytest.approx((0.5 - 0.2j) / turn(2.0) / 0.8, abs=1e-6)


@pytest.mark.parametrize("theta", [2.0, 0.3])
@pytest.mark.parametrize("share", [0.1 + 0.2j, 0.3j, -0.2 + 0j, 1 + 1j, 0j, 1 + 0j, -1 + 0j, 1j, -1j])
@pytest.mark.parametrize("wish", [0.5 - 0.2j, 0j, 1.5 + 0j])
def test_a_correction_adds_to_it_within_the_greatest_speed(wish: complex, share: complex, theta: float) -> None:
    m, body = wishing(wish, theta)
    correction.correct(m.d, body, share.real, share.imag)
    found = complex(m.d.wish_x, m.d.wish_y)
    wanted = wish + 0.8 * share * turn(theta)
    if share:
        wanted /= max(1.0, abs(wanted) / max(0.8, abs(wish)))
    assert found == pytest.approx(wanted)
    old = heading.regulate(body, wish.real, wish.imag, 0.0)
    new = heading.regulate(body, wanted.real, wanted.imag, 0.0)
    assert m.d.wish_speed == pytest.approx(0.3 + new[0] - old[0])
    assert m.d.wish_omega == pytest.approx(0.2 + new[1] - old[1])


def test_a_body_feels_its_limits() -> None:
    m = Mind()
    m.fill(heading=turn(1.0), speed=0.4, turn_rate=-0.3, max_speed=0.9, max_turn_rate=1.8)
    body = m.body()
    m.fill(heading=turn(1.0))
    controller.feel_body(m.f, m.o, body)
    assert complex(body.heading_cos, body.heading_sin) == pytest.approx(turn(1.0), abs=1e-6)
    found = body.speed, body.omega, body.max_speed, body.max_omega, body.dt
    assert found == pytest.approx((0.4, -0.3, 0.9, 1.8, 0.1))
    assert (body.acceleration, body.turn_acceleration) == (1e4, 1e4)
    m.fill(acceleration_time=0.5, turn_acceleration_time=0.25)
    controller.feel_body(m.f, m.o, body)
    assert (body.acceleration, body.turn_acceleration) == pytest.approx((1.8, 7.2))
    m.fill(acceleration_time=0.0, turn_acceleration_time=2.0)
    controller.feel_body(m.f, m.o, body)
    assert (body.acceleration, body.turn_acceleration) == pytest.approx((1e4, 0.9))
