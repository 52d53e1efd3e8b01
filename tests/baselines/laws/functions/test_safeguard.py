"""The price of a velocity and the choice of the cheapest, computed anew."""

from __future__ import annotations

import cmath
import math
from typing import Any

import numpy as np
import pytest
from tests.support.plain import plain

safeguard, heading = plain("laws.safeguard"), plain("laws.heading")
STEPS = (0.1, 0.1, 0.1, 0.15, 0.15, 0.2, 0.2, 0.25, 0.25)
HORIZON = sum(STEPS)
Disc = tuple[complex, complex, float, float]
"""Place (m), velocity (m/s), reach and margin (m)."""


def body_of(theta: float, speed: float = 0.6, omega: float = 0.3, **limits: float) -> Any:
    body = np.zeros(1, heading.BODY)[0]
    body.heading_cos, body.heading_sin = math.cos(theta), math.sin(theta)
    body.speed, body.omega, body.dt = speed, omega, 0.1
    body.max_speed, body.max_omega = limits.get("top", 1.0), 2.0
    body.acceleration, body.turn_acceleration = limits.get("a", 1.5), limits.get("w", 5.0)
    return body


def discs_of(*found: Disc) -> Any:
    discs = np.zeros(len(found), safeguard.DISC)
    for k, (at, v, reach, margin) in enumerate(found):
        assert safeguard.put_disc(discs, k, at.real, at.imag, v.real, v.imag, reach, margin) == k + 1
    return discs


def limited(value: float, old: float, change: float) -> float:
    return min(max(value, old - change), old + change)


def price(body: Any, found: list[Disc], speed: float, turn: float, wanted: complex) -> Any:
    """Cost, danger, whether it touches, and where it ends; discs are met in their order."""
    p, danger, time = 0j, 0.0, 0.0
    v, omega = float(body.speed), float(body.omega)
    theta = math.atan2(body.heading_sin, body.heading_cos)
    goal, error = theta + turn, turn
    for step in STEPS:
        most = min(math.sqrt(1.6 * body.turn_acceleration * abs(error)), body.max_omega)
        wish = min(max(error / step, -most), most)
        omega = limited(wish, omega, body.turn_acceleration * step)
        aim = speed * max(0.0, math.cos(theta - goal))
        v = limited(aim, v, body.acceleration * step)
        p += cmath.rect(v * step, theta + omega * step / 2)
        theta, error, time = theta + omega * step, error - omega * step, time + step
        for at, velocity, reach, margin in found:
            gap = abs(at + velocity * time - p) - reach
            if gap < 0.015:
                danger += 4.0 * (1.2 - time / HORIZON)
                return danger + 2.0, danger, True, p
            if gap < margin:
                danger += 3.0 * step / HORIZON * (1.0 - gap / margin)
    return danger + abs(p / HORIZON - wanted) / body.max_speed, danger, False, p


def drawn(rng: np.random.Generator) -> tuple[Any, list[Disc], complex]:
    found = [
        (
            cmath.rect(rng.uniform(0.4, 1.6), rng.uniform(-3, 3)),
            complex(*rng.normal(0, 0.4, 2)) * (rng.random() < 0.5),
            rng.uniform(0.2, 0.35),
            rng.uniform(0.05, 0.4),
        )
        for _ in range(rng.integers(1, 5))
    ]
    body = body_of(
        rng.uniform(-3, 3),
        rng.uniform(0, 1),
        rng.uniform(-1, 1),
        top=rng.uniform(0.7, 1.3),
        a=rng.choice([1.5, 50.0]),
        w=rng.choice([3.0, 50.0]),
    )
    return body, found, cmath.rect(rng.uniform(0.3, 1.0), rng.uniform(-3, 3))


@pytest.mark.parametrize("seed", range(20))
def test_the_price_is_that_of_the_simulated_motion(seed: int) -> None:
    rng = np.random.default_rng(seed)
    body, found, wanted = drawn(rng)
    speed, turn = abs(wanted), cmath.phase(wanted / complex(body.heading_cos, body.heading_sin))
    cost, danger, *_ = price(body, found, speed, turn, wanted)
    own = safeguard.cost_of(body, discs_of(*found), len(found), speed, turn, wanted.real, wanted.imag, 1e9)
    assert own == pytest.approx((cost, danger), abs=2e-3)
    if danger > 0.02:
        stopped = safeguard.cost_of(
            body, discs_of(*found), len(found), speed, turn, wanted.real, wanted.imag, danger / 9
        )
        assert stopped[1] > danger / 9
        assert stopped[0] in (stopped[1], stopped[1] + 2.0)


def choices(body: Any, found: list[Disc], wanted: complex) -> list[tuple[float, complex]]:
    """Cost and velocity of the wanted one, of rest, and of 16 directions at two speeds."""
    theta = complex(body.heading_cos, body.heading_sin)
    turn = cmath.phase(wanted / theta)
    options = [
        (price(body, found, abs(wanted), turn, wanted)[0], wanted),
        (price(body, found, 0.0, 0.0, wanted)[0], 0j),
    ]
    for k in range(16):
        away = (1 if k % 2 else -1) * ((k + 1) // 2) * math.pi / 8
        for share in (1.0, 0.5):
            goal = math.remainder(turn + away, math.tau)
            cost, *_ = price(body, found, share * body.max_speed, goal, wanted)
            options.append((cost + 0.02 * (k % 2), share * body.max_speed * theta * cmath.exp(1j * goal)))
    return options


@pytest.mark.parametrize("seed", range(25))
def test_the_cheapest_velocity_is_taken(seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    body, found, wanted = drawn(rng)
    theta = complex(body.heading_cos, body.heading_sin)
    plays = np.zeros(1, safeguard.PLAYS)[0]
    x, y, changed = safeguard.safe_velocity(body, discs_of(*found), len(found), wanted.real, wanted.imag, plays)
    danger = price(body, found, abs(wanted), cmath.phase(wanted / theta), wanted)[1]
    options = choices(body, found, wanted)
    if not changed:
        assert complex(x, y) == wanted
        assert danger == 0.0
        return
    assert danger > 0.0
    least, best = min(options, key=lambda option: option[0])
    second = min(cost for cost, v in options if abs(v - best) > 1e-9)
    cost = min(c for c, v in options if abs(v - complex(x, y)) < 1e-6)
    assert cost < least + 5e-3
    if second > least + 5e-3:
        assert complex(x, y) == pytest.approx(best)


@pytest.mark.parametrize("seed", range(10))
def test_all_velocities_at_once_end_where_each_does(seed: int) -> None:
    rng = np.random.default_rng(300 + seed)
    body, found, _ = drawn(rng)
    plays = np.zeros(1, safeguard.PLAYS)[0]
    error = rng.uniform(-3, 3)
    safeguard.begin_plays(body, error, plays)
    safeguard.play_all(body, discs_of(*found), len(found), plays)
    for m in range(32):
        away = (1 if m % 2 else -1) * ((m % 16 + 1) // 2) * math.pi / 8
        turn = math.remainder(error + away, math.tau)
        speed = body.max_speed * (1.0 if m < 16 else 0.5)
        _, danger, touches, end = price(body, found, speed, turn, 0j)
        assert plays.danger[m] == pytest.approx(danger, abs=2e-3)
        assert plays.going[m] == (not touches)
        if not touches:
            assert complex(plays.x[m], plays.y[m]) == pytest.approx(end, abs=2e-3)


def test_the_middle_of_a_turn_is_exact_enough() -> None:
    for turn in (-0.5, -0.1, 0.0, 0.3, 0.5):
        found = complex(*safeguard.half_turn(turn))
        assert found == pytest.approx(cmath.exp(0.5j * turn), abs=1e-5)


@pytest.mark.parametrize("theta", [0.0, 2.5])
def test_a_velocity_is_clear_near_the_present_one_with_nothing_on_its_way(theta: float) -> None:
    facing = cmath.rect(1.0, theta)

    def clear(wanted: complex, *found: Disc, speed: float = 0.6) -> bool:
        turned = discs_of(*((at * facing, v * facing, r, m) for at, v, r, m in found))
        way = wanted * facing
        return bool(safeguard.is_clear(body_of(theta, speed), turned, len(found), abs(wanted), way.real, way.imag))

    far: Disc = (9 + 0j, 0j, 0.3, 0.1)
    assert clear(0.6 + 0j, far)
    assert clear(0.89 + 0j, far)
    assert not clear(0.91 + 0j, far)
    assert not clear(0.29 + 0j, far)
    assert clear(cmath.rect(0.6, 0.34), far)
    assert clear(cmath.rect(0.6, -0.34), far)
    assert not clear(cmath.rect(0.6, 0.36), far)
    assert clear(0j, far, speed=0.2)
    # Reach, margin and glance are 0.55 m; ahead counts 1.5 s.
    assert not clear(0.6 + 0j, (0.7 + 0.54j, 0j, 0.3, 0.1))
    assert clear(0.6 + 0j, (0.7 + 0.56j, 0j, 0.3, 0.1))
    assert not clear(0.6 + 0j, (0.9 + 0.54 + 0j, 0j, 0.3, 0.1))
    assert clear(0.6 + 0j, (0.9 + 0.56 + 0j, 0j, 0.3, 0.1))
    assert clear(0.6 + 0j, (-0.56 + 0j, 0j, 0.3, 0.1))
    assert not clear(0.6 + 0j, (-0.54 + 0j, 0j, 0.3, 0.1))
    assert clear(0.6 + 0j, (0.7 + 0.2j, 0.6 + 0j, 0.3, 0.1))  # it keeps its distance
    assert not clear(0.6 + 0j, (0.7 + 1.4j, -0.6j, 0.3, 0.1))
    assert not clear(0.6 + 0j, far, (0.7 + 0j, 0j, 0.3, 0.1))
    assert clear(0.6 + 0j, (-0.3 + 0.4j + 0.2 * (-0.6 + 0.8j), 0.6 + 0.4j, 0.3, 0.1))


def test_what_is_safe_is_left_alone_and_walls_are_flat() -> None:
    plays = np.zeros(1, safeguard.PLAYS)[0]
    body = body_of(0.0)
    assert safeguard.safe_velocity(body, discs_of(), 0, 0.9, 0.1, plays) == (0.9, 0.1, False)
    behind = discs_of((-1 + 0j, 0j, 0.3, 0.1))
    # It is not near the present velocity, so it is simulated.
    assert safeguard.safe_velocity(body, behind, 1, 1.0, 0.0, plays) == (1.0, 0.0, False)
    discs = np.zeros(2, safeguard.DISC)
    assert safeguard.put_wall(discs, 0, 2.0, 0.6, 0.8, 0.15, 0.2) == 1
    wall = discs[0]
    edge = complex(wall.x, wall.y) - wall.reach * (0.6 + 0.8j)
    assert edge == pytest.approx((2.0 - 0.15) * (0.6 + 0.8j), abs=1e-9)
    assert (wall.speed_x, wall.speed_y, wall.margin) == (0.0, 0.0, 0.2)
    aside = edge + 3j * (0.6 + 0.8j)
    assert abs(complex(wall.x, wall.y) - aside) - wall.reach < 0.01
    assert safeguard.put_disc(discs, 2, 1.0, 1.0, 0.0, 0.0, 0.3, 0.1) == 2


def choose(body: Any, found: list[Disc], wanted: complex) -> tuple[complex, bool]:
    plays = np.zeros(1, safeguard.PLAYS)[0]
    x, y, changed = safeguard.safe_velocity(body, discs_of(*found), len(found), wanted.real, wanted.imag, plays)
    return complex(x, y), changed


def test_what_is_straight_ahead_is_passed_on_the_right() -> None:
    body = body_of(0.0, 0.6, 0.0)
    for ahead in (0.7, 0.8, 0.9):
        velocity, changed = choose(body, [(ahead + 0j, -0.3 + 0j, 0.3, 0.2)], 0.8 + 0j)
        assert changed
        assert velocity.imag < -0.1


def test_in_contact_no_velocity_is_better_than_the_wanted_one() -> None:
    velocity, changed = choose(body_of(0.4), [(0.1 + 0j, 0j, 0.5, 0.2)], 0.7 + 0.1j)
    assert (velocity, changed) == (0.7 + 0.1j, True)


def test_what_has_no_margin_is_avoided_too() -> None:
    body = body_of(0.0, 0.6, 0.0)
    found: list[Disc] = [(0.9 + 0.05j, 0j, 0.3, 0.0)]
    velocity, changed = choose(body, found, 0.8 + 0j)
    assert changed
    assert velocity == pytest.approx(min(choices(body, found, 0.8 + 0j), key=lambda c: c[0])[1])


@pytest.mark.parametrize("theta", [0.0, 2.5])
def test_one_that_can_only_stop_does(theta: float) -> None:
    facing = cmath.rect(1.0, theta)
    body = body_of(theta, 0.6, 0.0)
    places = (0.53, 0.1 + 0.33j, 0.1 - 0.33j, -0.3 + 0.3j, -0.3 - 0.3j)
    found: list[Disc] = [(place * facing, 0j, 0.3, 0.02) for place in places]
    wanted = 0.8 * facing
    assert min(choices(body, found, wanted), key=lambda c: c[0])[1] == 0j
    assert choose(body, found, wanted) == (0j, True)


def test_braking_is_judged_on_the_present_heading() -> None:
    body = body_of(0.0, 0.6, 0.0, a=0.5)
    found: list[Disc] = [(0.7 + 0j, 0j, 0.3, 0.02)]
    found += [(0.3 + 0.34j * side, 0j, 0.3, 0.02) for side in (1, -1)]  # a narrow passage
    assert choose(body, found, 0.8 + 0j) == (0j, True)


def test_where_every_way_ends_in_contact_the_latest_is_taken() -> None:
    rng = np.random.default_rng(0)
    body, found = body_of(0.0, 0.3, 0.0), []
    for angle in np.arange(8) * math.pi / 4:  # they close in from all sides
        at = cmath.rect(rng.uniform(0.5, 1.0), angle)
        found.append((at, -0.6 * at / abs(at), 0.3, 0.1))
    options = choices(body, found, 0.8 + 0j)
    least, best = min(options, key=lambda option: option[0])
    assert least > 2.0
    assert least < min(cost for cost, _ in options[:2]) < least + 1.0
    velocity, changed = choose(body, found, 0.8 + 0j)
    assert changed
    assert velocity == pytest.approx(best)


@pytest.mark.parametrize("theta", [0.4, -2.5])
def test_from_rest_it_gives_way_to_the_right(theta: float) -> None:
    facing = cmath.rect(1.0, theta)
    found: list[Disc] = [(1.1 * facing, -0.7 * facing, 0.3, 0.3)]
    velocity, changed = choose(body_of(theta, 0.0, 0.0), found, 0j)
    assert changed
    assert (velocity / facing).imag < -0.1


@pytest.mark.parametrize("theta", [0.4, -2.5])
def test_from_rest_the_directions_count_from_the_heading(theta: float) -> None:
    body = body_of(theta, 0.0, 0.0)
    away = cmath.rect(1.0, theta - 0.4)
    found: list[Disc] = [((0.2 + 0.9j) * away, (-0.1 - 0.9j) * away, 0.3, 0.3)]
    velocity, changed = choose(body, found, 0j)
    assert changed
    _, best = min(choices(body, found, 0j), key=lambda option: option[0])
    assert abs(best) > 0.1
    assert velocity == pytest.approx(best)
