"""The estimate of the target and the table of team-mates, recomputed in complex numbers."""

from __future__ import annotations

import cmath
import math
from typing import Any

import numpy as np
import pytest
from tests.support.minds import Mind, turn
from tests.support.plain import plain

monitoring = plain("ddcs.monitoring")


def near(value: complex) -> Any:
    return pytest.approx(value, abs=2e-5)


def short_way(angle: float) -> float:
    return cmath.phase(turn(angle))


def carried(s: Any, p: complex, theta: float, speed: float, rate: float, t: float) -> Any:
    """Position and heading after a time: turn rate and, after a second, speed decay."""
    if t > 1.0:
        t = 1.0 + s.way_memory * (1.0 - math.exp(-(t - 1.0) / s.way_memory))
    turned = rate * s.turn_memory * (1.0 - math.exp(-t / s.turn_memory))
    return p + cmath.rect(speed * t, theta + turned / 2), theta + turned


@pytest.mark.parametrize("time", [0.0, 0.3, 1.0, 1.6, 5.0])
def test_a_target_is_carried_on_with_decaying_turn_and_speed(time: float) -> None:
    m = Mind(played={"way_memory": 2.0, "turn_memory": 0.7})
    x, y, theta = monitoring.carry_on(m.s, 1.0, -2.0, 2.9, 0.6, 0.8, time)
    place, heading = carried(m.s, 1 - 2j, 2.9, 0.6, 0.8, time)
    assert complex(x, y) == pytest.approx(place)
    assert theta == pytest.approx(short_way(heading))


def test_an_estimate_of_the_past_is_left_as_it_is() -> None:
    assert monitoring.carry_on(Mind().s, 1.0, 2.0, 3.0, 0.6, 0.8, -0.1) == (1.0, 2.0, 3.0)


def test_the_slot_frame_turns_as_fast_as_its_outermost_slot_can_follow() -> None:
    assert monitoring.frame_limit(0.6, 1.0, 2.0) == pytest.approx(0.8 * 0.4 / 2.0)
    assert monitoring.frame_limit(0.2, 1.0, 2.0) == pytest.approx(0.2 / 2.0)
    assert monitoring.frame_limit(1.2, 1.0, 2.0) == 0.0


class Estimate:
    """What the layer should hold, from the fixes that it was given."""

    def __init__(self, s: Any, outermost: float) -> None:
        self.s, self.outermost, self.step = s, outermost, -1000
        self.speed, self.measured, self.usual_age = 0.0, False, 0.0
        self.p = self.raw = self.mean = 0j
        self.theta = self.psi = self.rate = 0.0

    def fix(self, step: int, p: complex, theta: float, psi: float) -> None:
        s = self.s
        t = (step - self.step) * 0.1
        if t > s.target_lost_after:
            self.p, self.rate = p, 0.0
            if not self.measured:
                self.speed = s.unknown_speed
            self.mean = cmath.rect(self.speed, theta)
        else:
            guess, _ = carried(s, self.p, self.theta, self.speed, self.rate, t)
            turned = short_way(theta - self.theta)
            self.rate = 0.0
            if t <= s.turn_memory:
                self.rate = turned / t
                along = ((p - self.raw) / turn(self.theta + turned / 2)).real / t
                share = 1.0 - math.exp(-t / s.speed_memory) if self.measured else 1.0
                self.speed = min(1.0, max(0.0, self.speed + share * (along - self.speed)))
                self.measured = True
            trust = 1.0 if abs(p - guess) > s.fix_jump else s.fix_trust
            self.p = guess + trust * (p - guess)
            self.mean += (1.0 - math.exp(-t / s.mean_memory)) * (cmath.rect(self.speed, theta) - self.mean)
        self.raw, self.theta, self.psi, self.step = p, theta, psi, step

    def check(self, m: Mind) -> None:
        s, d, age = self.s, m.d, (m.d.step - self.step) * 0.1
        if age <= s.late_fix:
            self.usual_age += 0.1 / s.gap_memory * (age - self.usual_age)
        now, theta = carried(s, self.p, self.theta, self.speed, self.rate, age)
        limit = monitoring.frame_limit(self.speed, 1.0, self.outermost)
        psi = self.psi + float(np.clip(short_way(theta - self.psi), -limit * age, limit * age))
        rate = short_way(theta - psi) / 0.1
        rate += s.turn_share * self.rate * math.exp(-age / s.turn_memory)
        assert d.known == (age <= s.target_lost_after)
        assert (d.age, d.usual_age, d.speed) == (near(age), near(self.usual_age), near(self.speed))
        assert complex(d.now_x, d.now_y) == near(now)
        assert turn(d.now_theta) == near(turn(theta))
        assert complex(d.mean_x, d.mean_y) == near(self.mean)
        assert complex(d.speed_x, d.speed_y) == near(cmath.rect(self.speed, theta))
        assert complex(d.frame_cos, d.frame_sin) == near(turn(psi))
        assert d.psi_rate == pytest.approx(np.clip(rate, -limit, limit), abs=2e-4)


@pytest.mark.parametrize("seed", range(4))
def test_the_estimate_follows_from_the_fixes(seed: int) -> None:
    rng = np.random.default_rng(seed)
    m = Mind(played={"target_lost_after": 1.45, "turn_share": 0.7, "late_fix": 0.45, "turn_memory": 0.95})
    m.d.step = 5
    wanted = Estimate(m.s, 2.0)
    p, theta, rate = 1 + 2j, 3.0, 0.9
    shown: dict[int, Any] = {}
    newest = -1
    for k in range(160):
        p, theta = p + cmath.rect(0.06, theta + rate * 0.05), theta + rate * 0.1
        if k % 50 == 40:
            p += 1.5  # a jump
        rate = -rate if k % 31 == 0 else rate
        own, heading = complex(*rng.normal(size=2)), rng.uniform(-3, 3)
        noisy = p + complex(*rng.normal(0, 0.02, 2))
        shown[m.d.step] = (noisy, theta, theta - 0.2)
        age = int(rng.choice([0, 0, 0, 1, 2, 4]))
        m.fill(target_known=0, target_seen=0)
        silent = 20 < k % 60 < 32 or k % 60 >= 44
        if rng.random() < 0.7 and not silent and m.d.step - age in shown:
            at, at_theta, at_psi = shown[m.d.step - age]
            m.stand(own, heading)
            sight = (at - own) / turn(heading)
            m.fill(
                target_known=1,
                target_seen=float(age == 0),
                target_age=0.1 * age,
                target_range=abs(sight),
                target_bearing=sight / abs(sight),
                target_heading=turn(at_theta - heading),
                target_frame=turn(at_psi - heading),
            )
            if m.d.step - age > newest:
                newest = m.d.step - age
                wanted.fix(newest, at, at_theta, at_psi)
        monitoring.watch_target(m.f, m.s, m.d, m.o, 2.0)
        assert m.d.sees == m.o[m.f.target_seen]
        if newest < 0:
            assert m.d.known == 0
        else:
            assert m.d.fix_step == newest
            wanted.check(m)
        m.d.step += 1


def show(m: Mind, at: complex, theta: float = 0.0) -> None:
    """A fix of this step, seen by a tracker at the origin that heads along x."""
    m.fill(
        target_known=1,
        target_seen=1,
        target_age=0,
        target_range=abs(at),
        target_bearing=at / abs(at),
        target_heading=turn(theta),
        target_frame=turn(theta),
    )
    monitoring.watch_target(m.f, m.s, m.d, m.o, 2.0)


def test_a_target_of_unknown_speed_has_a_share_of_the_own() -> None:
    m = Mind(played={"unknown_speed": 0.5})
    m.fill(max_speed=0.8)
    show(m, 3 + 0j)
    assert m.d.speed == near(0.4)


def test_a_fix_in_the_first_step_is_one_that_the_next_is_blended_with() -> None:
    m = Mind()
    show(m, 3 + 0j)
    m.d.step = 2
    show(m, 3.1 + 0j)
    assert m.d.speed == near(0.1 / 0.2)
    guess = 3.0 + 0.6 * 0.2
    assert m.d.x == near(guess + m.s.fix_trust * (3.1 - guess))


def test_a_target_that_slips_backwards_counts_as_at_rest() -> None:
    m = Mind()
    show(m, 3 + 0j)
    m.d.step = 2
    show(m, 2.9 + 0j)
    assert (m.d.speed, m.d.speed_known) == (0.0, 1)


@pytest.mark.parametrize("age", [0, 3, 8])
def test_a_caught_up_frame_turns_with_a_share_of_the_decaying_turn(age: int) -> None:
    m = Mind(played={"turn_share": 0.7, "turn_memory": 0.6})
    m.d.fix_step, m.d.step = 0, age
    m.d.speed, m.d.turn, m.d.theta, m.d.psi = 0.5, 0.4, 1.0, 1.0
    monitoring.watch_target(m.f, m.s, m.d, m.o, 0.1)  # the frame can turn at 4 rad/s
    assert m.d.psi_rate == near(0.7 * 0.4 * math.exp(-0.1 * age / 0.6))


@pytest.mark.parametrize("older", [0, 1])
def test_fixes_of_up_to_the_bounds_are_delayed_and_followed(older: int) -> None:
    m = Mind(played={"late_fix": 1.0, "target_lost_after": 2.0})
    m.d.fix_step, m.d.step = 0, 10 + older
    monitoring.watch_target(m.f, m.s, m.d, m.o, 2.0)
    assert (m.d.usual_age > 0.0) == (not older)
    m.d.step = 20 + older
    monitoring.watch_target(m.f, m.s, m.d, m.o, 2.0)
    assert m.d.known == (not older)


@pytest.mark.parametrize(("bounds", "turn_rate", "blended"), [(2, 0.4, True), (1, 0.0, False)])
def test_a_fix_measures_and_is_blended_up_to_the_bounds(bounds: float, turn_rate: float, blended: bool) -> None:
    m = Mind(played={"turn_memory": bounds, "target_lost_after": 1.5 * bounds, "fix_trust": 0.5})
    m.f.dt = 0.5
    show(m, 3 + 0j)
    m.d.step = 4
    show(m, 3.5 + 0j, 0.8)
    assert m.d.turn == near(turn_rate)
    m.d.step = 10
    show(m, 3.9 + 0j, 0.8)
    assert (m.d.x == near(3.9)) != blended


def test_without_radio_only_the_own_sensor_gives_fixes() -> None:
    m = Mind(played={"radio": False})
    m.fill(target_known=1, target_range=2.0, target_bearing=1 + 0j, target_heading=1 + 0j)
    m.fill(target_frame=1 + 0j)
    monitoring.watch_target(m.f, m.s, m.d, m.o, 2.0)
    assert (m.d.known, m.d.sees) == (0, 0)
    m.fill(target_seen=1)
    monitoring.watch_target(m.f, m.s, m.d, m.o, 2.0)
    assert (m.d.known, m.d.sees, m.d.now_x) == (1, 1, 2.0)


def test_messages_become_poses_in_the_common_frame() -> None:
    rng = np.random.default_rng(2)
    m = Mind(own=0)
    said: dict[int, Any] = {}
    gap = 0.0
    for k in range(100, 180):
        m.d.step = k
        own, heading = complex(*rng.normal(size=2)), rng.uniform(-3, 3)
        m.stand(own, heading)
        fresh, horizon = set(), 0.0
        gap -= gap * 0.1 / m.s.gap_memory
        for p in range(4):
            number, age = (p + 1, int(rng.choice([0, 0, 1, 2, 20]))) if rng.random() < 0.8 else (-1, 0)
            at, theta = complex(*rng.normal(size=2)), rng.uniform(-3, 3)
            words = [int(w) for w in rng.integers(-1, 6, 5)]
            way = at / turn(heading)
            m.fill(
                p,
                neighbour_number=number,
                neighbour_age=0.1 * age,
                neighbour_range=abs(way),
                neighbour_bearing=way / abs(way),
                neighbour_heading=turn(theta - heading),
                neighbour_speed=0.5 + 0.1 * p,
                neighbour_turn_rate=0.3 * p,
            )
            start = m.f.neighbour_message + p * m.f.stride
            m.o[start : start + 5] = [(w + 1) / 512 for w in words]
            if number < 0:
                continue
            if age < 15:
                horizon = abs(way)
            before = said.get(number)
            if before is None or k - age > before[0]:
                if before is not None and (k - before[0]) * 0.1 < m.s.lost_after:
                    gap = max(gap, (k - before[0]) * 0.1)
                said[number] = (k - age, own + at, cmath.rect(0.5 + 0.1 * p, theta), 0.3 * p, words)
                fresh.add(number)
        monitoring.hear_mates(m.f, m.s, m.d, m.mates, m.o)
        assert m.d.usual_gap == near(gap)
        assert m.d.horizon == near(horizon)
        assert {j for j in range(5) if m.mates[j].fresh} == fresh
        for j, (step, place, velocity, rate, words) in said.items():
            mate = m.mates[j]
            assert mate.step == step
            assert complex(mate.x, mate.y) == near(place)
            assert complex(mate.speed_x, mate.speed_y) == near(velocity)
            assert complex(mate.heading_cos, mate.heading_sin) == near(velocity / abs(velocity))
            assert mate.turn == near(rate)
            assert [mate.task, mate.leader, mate.term, mate.pulse, mate.slot] == words


def test_a_silence_of_over_twice_the_usual_ends_a_team_mate_s_presence() -> None:
    m = Mind(own=0)
    m.d.step, m.d.usual_gap = 100, 0.2
    assert monitoring.patience(m.s, m.d) == near(0.3 + 2 * 0.2)
    mate = m.mate(2, 1 + 1j, 0.5 - 0.2j, step=94)
    assert monitoring.is_there(m.f, m.s, m.d, mate, 5)
    assert complex(*monitoring.mate_now(m.f, m.s, m.d, mate)) == near(1.3 + 0.88j)
    mate.step = 92
    assert not monitoring.is_there(m.f, m.s, m.d, mate, 5)
    assert monitoring.is_there(m.f, m.s, m.d, mate, 6)  # it may have no place in the observation
    mate.step = 74
    assert not monitoring.is_there(m.f, m.s, m.d, mate, 6)
    assert complex(*monitoring.mate_now(m.f, m.s, m.d, mate)) == near(1 + 1j)
    m.d.usual_gap = 9.0
    assert monitoring.patience(m.s, m.d) == near(1.5)
    m.d.step, mate.step = 1, -1
    assert not monitoring.is_there(m.f, m.s, m.d, mate, 5)
    m.d.step, mate.step = 1, 0
    assert monitoring.is_there(m.f, m.s, m.d, mate, 5)
    deaf = Mind(played={"radio": False})
    deaf.fill(neighbour_number=2, neighbour_age=0.0)
    deaf.mates[3].fresh = 1
    monitoring.hear_mates(deaf.f, deaf.s, deaf.d, deaf.mates, deaf.o)
    assert (deaf.mates[2].step, deaf.mates[3].fresh) == (-1, 0)


def hear(m: Mind, step: int, number: int, age: float = 0.0, away: float = 1.0) -> None:
    m.d.step = step
    m.fill(neighbour_number=number, neighbour_age=age, neighbour_range=away)
    m.fill(neighbour_bearing=1 + 0j)
    monitoring.hear_mates(m.f, m.s, m.d, m.mates, m.o)


def test_number_0_and_step_0_count_like_others() -> None:
    m = Mind(own=1)
    hear(m, 0, 0, away=2.0)
    assert (m.mates[0].step, m.mates[0].fresh, m.mates[0].x) == (0, 1, 2.0)
    hear(m, 4, 0)
    assert (m.mates[0].step, m.mates[0].x) == (4, 1.0)
    assert m.d.usual_gap == near(0.4)


def test_a_step_longer_than_the_memory_of_silences_leaves_none() -> None:
    m = Mind(own=1)
    m.d.usual_gap, m.f.dt = 0.8, 20.0
    monitoring.hear_mates(m.f, m.s, m.d, m.mates, m.o)
    assert m.d.usual_gap == 0.0


def test_all_nearer_than_the_last_one_heard_in_time_are_listed() -> None:
    m = Mind(own=1)
    for age, horizon in ((1.4, 3.0), (1.5, 0.0), (1.6, 0.0)):  # the timeout is 1.5 s
        hear(m, 30, 2, age, away=3.0)
        assert m.d.horizon == horizon


def test_a_silence_of_just_the_timeout_is_none_and_no_usual_one() -> None:
    m = Mind(own=1)
    m.f.dt, m.d.usual_gap = 0.5, 0.6
    mate = m.mate(2, 1 + 1j, 0.5 - 0.2j, step=0)
    for step, there in ((3, True), (4, False)):  # 1.5 and 2 s
        m.d.step = step
        assert monitoring.is_there(m.f, m.s, m.d, mate, 5) == there
        now = 1.75 + 0.7j if there else 1 + 1j
        assert complex(*monitoring.mate_now(m.f, m.s, m.d, mate)) == near(now)
    for step, gap in ((3, 0.0), (2, 1.0)):
        m.d.usual_gap, mate.step = 0.0, 0
        hear(m, step, 2)
        assert m.d.usual_gap == gap


def test_a_first_message_ends_no_silence() -> None:
    m = Mind(own=0)
    m.d.step = 3
    m.fill(neighbour_number=2, neighbour_age=0.1, neighbour_range=1.0, neighbour_bearing=1 + 0j)
    monitoring.hear_mates(m.f, m.s, m.d, m.mates, m.o)
    assert (m.mates[2].step, m.d.usual_gap) == (2, 0.0)
