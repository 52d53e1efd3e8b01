"""Claims, appointments and handovers of one tracker, case by case."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
from tests.support.minds import Mind
from tests.support.plain import plain

leadership = plain("ddcs.tracking.leadership")
SEARCHING, CONVERGING = 0, 1


def leading(m: Mind) -> tuple[int, int, int]:
    return m.d.leader, m.d.term, m.d.pulse


def settle(m: Mind, position: complex = 0j) -> None:
    leadership.settle_lead(m.f, m.s, m.d, m.mates, m.own, position.real, position.imag)


def team(**values: Any) -> Mind:
    """Tracker 1 of five at the origin, which follows 3; all are heard; a target at 5 + 0j."""
    m = Mind(own=1, played={"model": "centralized"})
    m.d.step = 40
    for j in (0, 2, 3, 4):
        m.mate(j, complex(-j, 1.0), leader=3, term=7, pulse=20)
    m.target(5 + 0j)
    values = {"leader": 3, "term": 7, "pulse": 20, "pulse_step": 40, "task": CONVERGING, **values}
    for name, value in values.items():
        setattr(m.d, name, value)
    return m


def test_of_two_claims_the_newer_term_wins_and_then_the_lower_number() -> None:
    for (t, a), (u, b) in product(product((0, 5, 130, 255), (-1, 0, 2)), repeat=2):
        newer = 0 < (t - u) % 256 < 128
        wanted = a >= 0 and (b < 0 or newer or (t == u and a < b))
        assert leadership.better_claim(t, a, u, b) == wanted


def test_an_appointment_counts_as_an_exchange_if_another_led() -> None:
    m = Mind()
    m.d.step, m.d.confirmed = 9, 1
    leadership.appoint(m.d, 2, 3, 4)
    assert (*leading(m), m.d.pulse_step, m.d.exchanges, m.d.confirmed) == (2, 3, 4, 9, 0, 0)
    m.d.step, m.d.confirmed = 10, 1
    leadership.appoint(m.d, 2, 5, 6)
    assert (*leading(m), m.d.pulse_step, m.d.exchanges, m.d.confirmed) == (2, 5, 6, 10, 0, 1)
    leadership.appoint(m.d, 0, 6, 0)
    leadership.appoint(m.d, 1, 7, 0)
    assert (*leading(m), m.d.exchanges, m.d.confirmed) == (1, 7, 0, 2, 0)


def test_the_nearest_to_the_target_is_found_among_those_that_work() -> None:
    m = team()
    m.target(3 + 4j)
    for j, p in ((0, 3 + 0j), (2, 3 + 3.5j), (3, 2 + 4j), (4, 3 + 4.1j)):
        m.mate(j, p)
    m.mates[4].step = 0  # silent for long

    def nearest(barred: int, at: complex = 0j) -> Any:
        return leadership.nearest_tracker(m.f, m.s, m.d, m.mates, 1, at.real, at.imag, barred)

    assert nearest(-1) == pytest.approx((2, 0.5, 5.0))
    assert nearest(2) == pytest.approx((3, 1.0, 5.0))
    m.mates[2].speed_y, m.mates[2].step = 0.5, 38  # now at 3 + 3.6j
    assert nearest(-1) == pytest.approx((2, 0.4, 5.0), abs=1e-5)
    m.mate(2, 3 + 9j)
    m.mate(3, 3 + 9j)
    assert nearest(0) == pytest.approx((1, 5.0, 5.0))  # itself
    assert nearest(0, 2 + 3j) == pytest.approx((1, 2**0.5, 2**0.5))


@pytest.mark.parametrize("seed", range(8))
def test_the_most_central_has_the_least_sum_of_distances(seed: int) -> None:
    rng = np.random.default_rng(seed)
    m = Mind(own=2)
    m.d.step = 100
    places = [complex(*rng.normal(0, 3, 2)) for _ in range(5)]
    heard = [j for j in range(5) if j == 2 or rng.random() < 0.7]
    for j in range(5):
        if j != 2:
            m.mate(j, places[j], step=100 if j in heard else 20)
    sums = {i: sum(abs(places[i] - places[j]) for j in heard) for i in heard}
    found = leadership.central_tracker(m.f, m.s, m.d, m.mates, 2, places[2].real, places[2].imag)
    assert found == (min(heard, key=lambda i: sums[i]), len(heard) - 1)


def test_of_equally_central_ones_the_lower_number_is_taken() -> None:
    m = Mind(own=3, num_trackers=4)
    m.d.step = 100
    for j, p in ((0, 1e-5 + 0j), (1, 1 + 0j), (2, 1j)):
        m.mate(j, p)
    assert leadership.central_tracker(m.f, m.s, m.d, m.mates, 3, 1.0, 1.0) == (0, 3)


def test_who_appoints_takes_the_nearest_or_the_most_central() -> None:
    def selected(m: Mind, barred: int) -> tuple[int, int, int]:
        leadership.select_leader(m.f, m.s, m.d, m.mates, 1, 0.0, 0.0, barred)
        return leading(m)

    assert selected(team(), -1) == (1, 8, 0)  # the target is at 5 + 0j, the others behind
    assert selected(team(term=255), -1) == (1, 0, 0)
    assert selected(team(known=0), -1) == (2, 8, 0)  # at -2 + 1j, in the middle
    assert selected(team(known=0), 2) == (1, 8, 0)
    alone = team(known=0, term=0)
    for j in (0, 2, 3, 4):
        alone.mates[j].step = -1
    assert selected(alone, -1) == (1, 255, 0)


def test_claims_are_adopted_and_pulses_relayed() -> None:
    m = team(pulse_step=30, confirmed=0)
    m.mates[0].fresh, m.mates[0].pulse = 1, 21
    m.mates[2].pulse = 30  # not heard in this step
    settle(m)
    assert (*leading(m), m.d.pulse_step, m.d.confirmed) == (3, 7, 21, 40, 1)
    m = team(pulse_step=39, confirmed=0)
    m.mates[0].fresh, m.mates[0].pulse = 1, 20
    settle(m)
    assert (*leading(m), m.d.pulse_step, m.d.confirmed) == (3, 7, 20, 39, 0)
    m = team()
    for j, (leader, term) in {0: (-1, 9), 2: (4, 8), 4: (0, 7)}.items():
        m.mates[j].fresh, m.mates[j].leader, m.mates[j].term, m.mates[j].pulse = 1, leader, term, 5
    settle(m)
    assert (*leading(m), m.d.exchanges) == (4, 8, 5, 1)
    m = team()  # the same term, other leaders: the lower number wins, and its pulse
    m.mates[4].fresh, m.mates[4].leader, m.mates[4].pulse = 1, 4, 33
    settle(m)
    assert leading(m) == (3, 7, 20)
    m.mates[2].fresh, m.mates[2].leader, m.mates[2].term, m.mates[2].pulse = 1, 3, 6, 99
    settle(m)
    assert leading(m) == (3, 7, 20)
    m.mates[2].fresh, m.mates[2].leader, m.mates[2].term, m.mates[2].pulse = 1, 0, 8, 99
    settle(m)
    assert leading(m) == (0, 8, 99)


def test_a_leader_counts_and_the_first_one_is_appointed_at_once() -> None:
    m = team(leader=1, term=7, pulse=255, pulse_step=3, confirmed=0, step=41)
    settle(m)
    assert (*leading(m), m.d.pulse_step, m.d.confirmed) == (1, 7, 0, 41, 1)
    m = team(leader=-1, term=0)
    settle(m)
    assert leading(m) == (1, 1, 0)
    m = team(leader=-1, term=0)
    m.mate(0, 4 + 0j)
    settle(m)
    assert leading(m) == (0, 1, 0)


def test_the_first_tracker_may_lead_too() -> None:
    m = team(leader=0)
    settle(m)
    assert leading(m) == (0, 7, 20)


def test_a_leader_hands_over_to_who_is_clearly_nearer_every_time_lag() -> None:
    def after(step: int, x: float, own: int = 1, nearer: int = 2, **values: Any) -> int:
        m = team(leader=own, step=step, **values)
        m.own = own
        for j in range(5):
            m.mate(j, complex(-j, 1.0))
        m.mate(nearer, complex(x, 0.0))
        settle(m)
        assert m.d.leader in (own, nearer)
        assert (m.d.term, m.d.pulse) == ((8, 0) if m.d.leader == nearer else (7, 21))
        return int(m.d.leader)

    for own, nearer in ((1, 0), (0, 1), (4, 3)):
        assert after(40, 0.7, own, nearer) == nearer

    assert after(40, 0.7) == 2
    assert after(40, 0.5) == 1  # less than the hysteresis, 0.6 m
    assert after(45, 0.7) == 1  # not due: every second, 10 steps
    assert after(40, 0.7, known=0) == 1


@pytest.mark.parametrize("dt", [0.1, 1.0])
def test_the_lead_is_checked_in_every_step_at_the_least(dt: float) -> None:
    for step in (40, 41):
        m = team(leader=1, step=step)
        m.s.time_lag, m.f.dt = 0.1, dt
        m.mate(2, 4 + 0j)
        settle(m)
        assert m.d.leader == 2


def test_a_silent_leader_is_replaced_after_the_patience() -> None:
    def after(silent: int, **values: Any) -> int:
        m = team(pulse_step=40 - silent, **values)
        m.mate(3, 4.9 + 0j)
        settle(m)
        return int(m.d.leader)

    # 0.3 s and 0.2 s for a leader: 5 steps
    assert after(4) == 3
    assert after(6) == 1  # 3 is the nearest, and barred
    assert after(6, usual_gap=0.1) == 3
    assert after(8, usual_gap=0.1) == 1
    assert after(6, task=SEARCHING, known=0) == 0  # the most central


def test_a_leader_is_replaced_later_than_after_the_patience() -> None:
    for silent, leader in ((4, 3), (5, 1)):  # 2 and 2.5 s
        m = team(pulse_step=40 - silent, usual_gap=0.6)  # 1.5 s for a team-mate
        m.f.dt, m.s.lead_patience = 0.5, 0.5
        settle(m)
        assert m.d.leader == leader


def test_without_the_exchange_the_lead_changes_in_the_search_only() -> None:
    for task, leader in ((CONVERGING, 3), (SEARCHING, 1)):
        m = team(pulse_step=10, task=task)
        m.s.forbidden = sum(1 << (4 * t + 3) for t in (1, 2))
        settle(m)
        assert m.d.leader == leader
