"""The law of each task, against the paper's equations in complex numbers."""

from __future__ import annotations

import cmath
import math
from typing import Any

import numpy as np
import pytest
from tests.support.minds import Mind, turn
from tests.support.plain import plain

tracking, steering = plain("ddcs.tracking.motion"), plain("laws.steering")
heading_law = plain("laws.heading")
CONVERGING, FLOCKING, EXCHANGING = 1, 2, 3
TARGET, PSI, RATE = 2 + 1j, 0.4, 0.25


def short_way(angle: float) -> float:
    return cmath.phase(turn(angle))


def near(value: Any) -> Any:
    return pytest.approx(value, abs=2e-5)


def mind(task: int = FLOCKING, own: int = 1, **played: Any) -> Mind:
    m = Mind("constant", own=own, played=played, sensing_range=4.0)
    m.d.step, m.d.slot, m.d.task = 40, 3, task
    m.target(TARGET, cmath.rect(0.5, 0.7), PSI, psi_rate=RATE)
    m.d.mean_x, m.d.mean_y = 0.2, 0.1
    return m


def check(found: Any, velocity: complex, body: Any, rate: float) -> None:
    assert complex(*found[:2]) == near(velocity)
    assert found[2:] == near(heading_law.regulate(body, velocity.real, velocity.imag, rate))


def test_a_velocity_is_taken_up_with_its_turn() -> None:
    m = mind()
    body = m.body(0j, 0.9)
    check(tracking.take_up(body, 0.3, 0.4, 0.6), 0.3 + 0.4j, body, 0.6)


@pytest.mark.parametrize("slot", range(5))
def test_a_lost_target_is_hunted_on_a_growing_ring(slot: int) -> None:
    m = mind()
    m.d.slot, m.d.age = slot, 2.0
    body = m.body(1 + 1j, 0.2)
    side = (0, 1, -1, 2, -2)[slot]  # odd slots to the left
    place = TARGET + cmath.rect(0.3 * 2.0, 0.7 + side * 2 * math.pi / 5)
    way = place - (1 + 1j)
    velocity = way / abs(way) * min(1.0, 1.5 * abs(way))
    check(tracking.hunt(m.s, m.d, 5, 1.0, 1.0, body), velocity, body, 0.0)
    far = m.body(30 + 1j, 0.2)
    way = place - (30 + 1j)
    check(tracking.hunt(m.s, m.d, 5, 30.0, 1.0, far), way / abs(way), far, 0.0)
    m.d.age = 0.0  # the ring is a point, and this one there
    check(tracking.hunt(m.s, m.d, 5, 2.0, 1.0, body), 0j, body, 0.0)


@pytest.mark.parametrize("task", [CONVERGING, FLOCKING])
@pytest.mark.parametrize("at", [-1 - 1j, 3 + 3j, 4 + 2j])
def test_to_a_slot_leads_the_slot_law_and_before_it_an_intercept(task: int, at: complex) -> None:
    m = mind(task, aim_ahead=0.2, feed_forward=0.5, clearance=0.9)
    body = m.body(at, 0.2)
    arm = (m.slot(3) + 0.2) * turn(PSI)
    converging = task == CONVERGING
    own = at - TARGET
    v = steering.meeting_velocity(
        own.real,
        own.imag,
        arm.real,
        arm.imag,
        float(m.d.speed_x),
        float(m.d.speed_y),
        0.2,
        0.1,
        RATE,
        1.5,
        0.9 if converging else 0.0,
        1e6 if converging else 1.5,
        1.0,
        1e4,
    )
    found = tracking.to_slot(m.s, m.d, m.slots, at.real, at.imag, body)
    check(found, complex(*v), body, 0.0 if converging else 0.5 * RATE)


def pngl(m: Mind, k: float, at: complex, deviation: str) -> tuple[complex, float]:
    """Velocity and turn rate of θ = K σ + c, with (13) or at full speed."""
    arm = m.slot(3) * turn(PSI)
    away = TARGET - at
    r, sigma = abs(away), cmath.phase(away)
    target = cmath.rect(0.5, 0.7)
    sigma_d, theta_d, rate = 0.0, 0.0, 0.0
    flocking = m.d.task == FLOCKING
    if deviation != "none":
        sigma_d, theta_d, rate = cmath.phase(-arm), PSI, RATE
        if deviation == "occupant":
            theta_d = cmath.phase(target + 1j * RATE * arm)
        if flocking:
            k += m.s.bearing_gain
        if deviation == "occupant" and flocking:
            k *= max(-1.0, min(1.0, math.cos(theta_d - sigma_d) / 0.6))
    theta = theta_d + k * short_way(sigma - sigma_d)
    delta = short_way(theta - sigma)
    speed = 1.0
    if flocking:
        along = (target / turn(sigma)).real + m.s.range_gain * (r - abs(arm))
        if abs(math.cos(delta)) >= 0.6:
            speed = along / math.cos(delta)
        else:
            aside = (target / turn(sigma)).imag - r * rate
            speed = along * math.cos(delta) + aside * math.sin(delta)
        speed = max(0.0, min(1.0, speed))
    else:
        delta = max(-0.7, min(0.7, delta))
    velocity = cmath.rect(speed, sigma + delta)
    sigma_rate = ((target - velocity) / turn(sigma)).imag / r
    return velocity, k * sigma_rate + (1.0 - k) * rate


@pytest.mark.parametrize("deviation", ["none", "slot", "occupant"])
@pytest.mark.parametrize("task", [CONVERGING, FLOCKING])
@pytest.mark.parametrize("slot", [None, 1.2 + 0.1j, -1.2 + 0.1j])
def test_pngl_heads_at_k_sigma_plus_c(task: int, deviation: str, slot: complex | None) -> None:
    rng = np.random.default_rng(4)
    m = mind(task, deviation=deviation, bearing_gain=0.3, range_gain=0.7)
    if slot:
        m.slots["x"][3], m.slots["y"][3] = slot.real, slot.imag
    for k in (0.9, 1.0, 1.1):
        for _ in range(8):
            at, theta = TARGET + complex(*rng.normal(0, 1.5, 2)), rng.uniform(-3, 3)
            body = m.body(at, theta)
            m.d.closing = 5
            found = tracking.pursue(m.s, m.d, k, m.slots[3], at.real, at.imag, body)
            velocity, rate = pngl(m, k, at, deviation)
            check(found, velocity, body, rate)
            assert m.d.closing == (task == CONVERGING)


def test_each_tracker_has_a_constant_of_its_own_in_the_distributed_model() -> None:
    def constant(own: int, n: int, **played: Any) -> float:
        m = Mind(played={"navigation_constant": 0.98, "spread": 0.08, **played})
        return float(tracking.own_constant(m.s, own, n))

    assert [constant(i, 5) for i in range(5)] == pytest.approx([0.90, 0.94, 0.98, 1.02, 1.06])
    assert [constant(i, 2) for i in range(2)] == pytest.approx([0.90, 1.06])
    assert constant(0, 1) == constant(3, 5, model="centralized") == 0.98


def test_who_follows_has_a_leader_that_it_hears() -> None:
    def does(leader: int = 0, step: int = 40, model: str = "centralized", *forbidden: str) -> bool:
        m = mind(model=model, forbidden=forbidden)
        m.mate(0, 1j, step=step)
        m.mate(1, 1j)
        m.mate(4, 1j)
        m.d.leader = leader
        return bool(tracking.follows(m.f, m.s, m.d, m.mates, 1))

    assert does()
    assert not does(-1)
    assert not does(1)
    assert not does(model="distributed")
    assert not does(step=10)
    assert does(0, 10, "centralized", "flocking>exchange")
    assert does(0, 0, "centralized", "flocking>exchange")
    assert not does(0, -1, "centralized", "flocking>exchange")
    assert not does(0, 10, "centralized", "converging>exchange", "flocking>converging")


def centralized(**played: Any) -> Mind:
    m = mind(model="centralized", **played)
    m.mate(0, 1 + 1j, cmath.rect(0.6, 0.5), slot=0, task=FLOCKING)
    m.d.leader = 0
    return m


def test_the_error_is_the_distance_from_the_place_or_the_excess_of_the_range() -> None:
    def error(m: Mind, at: complex) -> float:
        m.d.pursues = 7
        tracking.note_error(m.f, m.s, m.d, m.mates, m.slots, 1, at.real, at.imag)
        return float(m.d.error)

    m = mind()
    assert error(m, 1 - 2j) == near(abs(TARGET + m.slot(3) * turn(PSI) - (1 - 2j)))
    assert m.d.pursues == 0
    m = mind(guidance="pngl")
    assert error(m, 1 - 6j) == near(abs(TARGET - (1 - 6j)) - abs(m.slot(3)))
    assert m.d.pursues == 1
    assert error(m, TARGET + 0.3) == 0.0
    m = centralized(guidance="pngl")
    place = 1 + 1j + (m.slot(3) - m.slot(0)) * turn(0.5)
    assert error(m, 1 - 2j) == near(abs(place - (1 - 2j)))
    assert m.d.pursues == 0


def test_each_task_has_its_law() -> None:
    at = 0.5 - 0.5j

    def wanted(m: Mind) -> Any:
        body = m.body(at, 0.3)
        return tracking.wanted_motion(m.f, m.s, m.d, m.mates, m.slots, 1, at.real, at.imag, body), body

    m = mind(EXCHANGING)
    m.d.turn, m.d.age = 0.35, 9.0
    found, body = wanted(m)
    check(found, cmath.rect(0.5, 0.7), body, 0.35)
    for guidance, law in (("slot", "to_slot"), ("pngl", "pursue")):
        m = mind(guidance=guidance, spread=0.06)
        found, body = wanted(m)
        if law == "to_slot":
            same = tracking.to_slot(m.s, m.d, m.slots, at.real, at.imag, body)
        else:
            same = tracking.pursue(m.s, m.d, 0.97, m.slots[3], at.real, at.imag, body)
        assert found == near(same)
    m.d.usual_age, m.d.age = 0.1, 0.36
    found, body = wanted(m)
    assert found == near(tracking.hunt(m.s, m.d, 5, at.real, at.imag, body))
    m.f.sight = 7.9
    assert wanted(m)[0] == found
    m.d.age = 0.34
    assert wanted(m)[0] == near(same)
    m.d.age, m.f.sight = 0.36, 8.0
    assert wanted(m)[0] == near(same)


@pytest.mark.parametrize("task", [CONVERGING, FLOCKING])
def test_a_follower_goes_to_its_place_on_the_leader(task: int) -> None:
    m = centralized()
    m.d.task = task
    body = m.body(-2 + 3j, 0.3)
    found = tracking.wanted_motion(m.f, m.s, m.d, m.mates, m.slots, 1, -2.0, 3.0, body)
    if task == FLOCKING:
        same = plain("ddcs.tracking.following").on_leader(m.f, m.s, m.d, m.mates, m.slots, 1, -2.0, 3.0, body)
        assert found == near(same)
        return
    x, y, vx, vy = plain("ddcs.tracking.following").place_on_leader(m.f, m.s, m.d, m.mates[0], m.slots[3], m.slots[0])
    v = steering.approach_velocity(x + 2, y - 3, vx, vy, 1e6, 1.0, 1e4)
    assert abs(complex(*v)) == pytest.approx(1.0)
    check(found, complex(*v), body, 0.0)
    straight = m.body(-2 + 3j, cmath.phase(complex(*v)))
    found = tracking.wanted_motion(m.f, m.s, m.d, m.mates, m.slots, 1, -2.0, 3.0, straight)
    assert found[2:] == near((1.0, 0.0))
