"""A follower's place on the leader, and its command, in complex numbers."""

from __future__ import annotations

import cmath
from typing import Any

import numpy as np
import pytest
from tests.support.minds import Mind, turn
from tests.support.plain import plain

following = plain("ddcs.tracking.following")
laws_phi, laws_l_l = plain("laws.l_phi"), plain("laws.l_l")
FLOCKING = 2


def short_way(angle: float) -> float:
    return cmath.phase(turn(angle))


def near(value: Any) -> Any:
    return pytest.approx(value, abs=2e-5)


def follower(frame: str = "leader", law: str = "l-phi") -> Mind:
    """Tracker 1, whose leader 0 turns at 0.4 rad/s, 0.2 s ago at 1 + 1j; slots of a wedge."""
    m = Mind(
        "constant", own=1, played={"model": "centralized", "follower_frame": frame, "follower_law": law, "alpha_1": 1.5}
    )
    m.d.step, m.d.slot, m.d.leader, m.d.task = 40, 3, 0, FLOCKING
    m.mate(0, 1 + 1j, cmath.rect(0.6, 2.0), turn=0.4, step=38, slot=0, task=FLOCKING)
    m.target(3 + 1j, cmath.rect(0.5, 1.9), 1.8, psi_rate=0.3)
    return m


LEADER = 1 + 1j + 0.2 * cmath.rect(0.6, 2.0)
THETA = 2.0 + 0.2 * 0.4


def test_a_team_mate_keeps_its_speed_and_turn_until_it_is_silent_for_too_long() -> None:
    m = follower()
    mate = m.mates[0]
    assert following.motion_of(m.f, m.s, m.d, mate) == near((0.6, THETA, 0.4))
    mate.step = 30
    assert following.motion_of(m.f, m.s, m.d, mate) == near((0.0, 2.0, 0.0))
    m.d.step, mate.step = 1, 0  # at the start it is expected to move as the target does
    assert following.motion_of(m.f, m.s, m.d, mate) == near((0.5, 2.04, 0.4))
    m.d.step, mate.step = 2, 1
    mate.turn, mate.heading_cos, mate.heading_sin = 20.0, -1.0, 0.1
    heading = np.pi - np.arctan(0.1) + 2.0
    assert following.motion_of(m.f, m.s, m.d, mate) == near((0.6, short_way(heading), 20.0))


def test_a_silence_of_just_the_timeout_is_none() -> None:
    m = follower()
    m.f.dt, m.d.usual_gap = 0.5, 0.6
    for step, speed in ((37, 0.6), (36, 0.0)):  # 1.5 and 2 s
        m.mates[0].step = step
        assert following.motion_of(m.f, m.s, m.d, m.mates[0])[0] == near(speed)


@pytest.mark.parametrize("frame", ["leader", "slot-frame"])
def test_a_place_on_the_leader_is_the_difference_of_the_slots(frame: str) -> None:
    m = follower(frame)
    angle, rate = (THETA, 0.4) if frame == "leader" else (1.8, 0.3)
    arm = (m.slot(3) - m.slot(0)) * turn(angle)
    found = following.place_on_leader(m.f, m.s, m.d, m.mates[0], m.slots[3], m.slots[0])
    velocity = cmath.rect(0.6, THETA) + 1j * rate * arm
    assert (complex(*found[:2]), complex(*found[2:])) == (near(LEADER + arm), near(velocity))


def demand(m: Mind, body: Any, frame: str, leader: complex, theta: float, rate: float, k: int) -> Any:
    """l, A, B and the two directions of a demand on a robot of slot k."""
    angle, rate = (theta, rate) if frame == "leader" else (1.8, 0.3)
    arm = (m.slot(3) - m.slot(k)) * turn(angle)
    moving = cmath.rect(0.6, theta) + 1j * rate * arm
    point = complex(m.o[m.f.position], m.o[m.f.position + 1]) + 0.15 * complex(body.heading_cos, body.heading_sin)
    wanted = arm + 0.15 * moving / abs(moving)
    seen = point - leader
    alphas = [(1.0 - np.exp(-a * 0.1)) / 0.1 for a in (1.5, 2.0)]
    a = alphas[0] * (abs(wanted) - abs(seen)) + 0.6 * np.cos(cmath.phase(seen) - theta)
    turning = alphas[1] * cmath.phase(wanted / seen) + rate
    b = abs(seen) * turning - 0.6 * np.sin(cmath.phase(seen) - theta)
    return abs(seen), a, b, cmath.phase(seen), cmath.phase(wanted)


@pytest.mark.parametrize("frame", ["leader", "slot-frame"])
@pytest.mark.parametrize("heading", [2.2, -2.5])
def test_a_follower_under_l_phi_closes_in_at_its_rates(frame: str, heading: float) -> None:
    m = follower(frame)
    place = LEADER + (m.slot(3) - m.slot(0)) * turn(2.0) + 0.3 - 0.2j
    body = m.body(place, heading)
    wanted = demand(m, body, frame, LEADER, THETA, 0.4, 0)
    found = following.demand_on(m.f, m.s, m.d, m.mates[0], m.slots[3], m.slots[0], place.real, place.imag, body)
    assert found[:3] == near(wanted[:3])
    assert [turn(a) for a in found[3:]] == near([turn(a) for a in wanted[3:]])
    vx, vy, speed, omega = following.on_leader(m.f, m.s, m.d, m.mates, m.slots, 1, place.real, place.imag, body)
    velocity = complex(wanted[1], wanted[2]) * turn(wanted[3])
    assert complex(vx, vy) == near(velocity)
    own = velocity / turn(heading)
    held = laws_phi.held_command(own.real, own.imag, 0.15, 0.1)
    assert (speed, omega) == near(laws_phi.limit_command(*held, 0.15, 1.0, 2.0))


def test_any_tracker_may_be_the_leader() -> None:
    found = []
    for number in (0, 2):
        m = follower()
        m.mate(number, 1 + 1j, cmath.rect(0.6, 2.0), turn=0.4, step=38, slot=0, task=FLOCKING)
        m.mate(2 - number, -3 + 2j, 0.3 + 0j)
        m.d.leader = number
        body = m.body(-1 + 1j, 2.2)
        found.append(following.on_leader(m.f, m.s, m.d, m.mates, m.slots, 1, -1.0, 1.0, body))
    assert found[0] == found[1]


@pytest.mark.parametrize(("leader", "number"), [(0, 3), (3, 0)])
def test_a_follower_under_l_l_keeps_its_distances_from_two(leader: int, number: int) -> None:
    m = follower("slot-frame", "l-l")
    m.d.leader = leader
    m.mate(leader, 1 + 1j, cmath.rect(0.6, 2.0), turn=0.4, step=38, slot=0, task=FLOCKING)
    other = LEADER + (m.slot(2) - m.slot(0)) * turn(1.8)
    m.mate(number, other, cmath.rect(0.6, THETA), turn=0.4, slot=2, task=FLOCKING)
    place = LEADER + (m.slot(3) - m.slot(0)) * turn(1.8) + 0.1 - 0.1j
    body = m.body(place, 2.2)
    assert following.second_of(m.f, m.s, m.d, m.mates, m.slots, 1) == number
    first = demand(m, body, "slot-frame", LEADER, THETA, 0.4, 0)
    second = demand(m, body, "slot-frame", other, THETA, 0.4, 2)
    gammas = [short_way(d[3] - 2.2) for d in (first, second)]
    ahead, across = laws_l_l.l_l_velocity(*first[:3], gammas[0], *second[:3], gammas[1], second[4] - first[4], 0.15)
    vx, vy, *_ = following.on_leader(m.f, m.s, m.d, m.mates, m.slots, 1, place.real, place.imag, body)
    assert complex(vx, vy) == near(complex(ahead, across) * turn(2.2))
    m.s.follower_law = 0  # l-φ takes no second one
    vx, vy, *_ = following.on_leader(m.f, m.s, m.d, m.mates, m.slots, 1, place.real, place.imag, body)
    assert complex(vx, vy) == near(complex(first[1], first[2]) * turn(first[3]))


def test_the_second_robot_has_the_last_slot_before_the_own_that_lies_aside() -> None:
    """Of a wedge: 0 in front, 1 and 3 on one side of it in line, 2 and 4 on the other."""
    m = follower("slot-frame", "l-l")

    def second(slot: int, own: int = 1) -> int:
        m.d.slot = slot
        return int(following.second_of(m.f, m.s, m.d, m.mates, m.slots, own))

    m.mate(2, 0j, slot=1, task=FLOCKING)
    m.mate(3, 0j, slot=2, task=FLOCKING)
    assert second(3) == 3
    assert second(4) == 2
    assert second(2) == 2
    m.mate(4, 0j, slot=4, task=1)
    assert second(4) == 2  # whatever those say that are not in their places
    assert second(1) == -1
    m.mates[2].slot = 2  # in line with slot 4
    assert second(4) == -1
    m.mates[2].slot, m.mates[3].task = 1, 1
    assert second(3) == -1  # slot 1 is in line, and the robot of slot 2 is not in its place
    assert second(4) == 2
    m.mates[2].step = 3
    assert second(4) == -1
    m.mate(2, 0j, slot=1, task=FLOCKING)
    m.d.leader = 2
    assert second(4) == -1
    m.d.leader = 0
    assert second(4, own=2) == -1
    m.mates[2].slot = -1
    assert second(4) == -1
    m.d.leader = 4
    m.mate(0, 0j, slot=3, task=FLOCKING)
    m.mates[2].slot = 1
    assert second(4) == 0
    square = Mind("constant", own=1, played={"follower_law": "l-l"}, num_trackers=6, formation="rows")
    square.d.slot, square.d.leader = 5, 0
    for j, k in ((2, 3), (3, 4), (4, 2)):
        square.mate(j, 0j, slot=k, task=FLOCKING)
    ways = {k: square.slot(5) - square.slot(k) for k in (0, 2, 3, 4)}
    kept = [k for k in (2, 3, 4) if abs(np.sin(cmath.phase(ways[0] / ways[k]))) >= 0.3]
    wanted = {3: 2, 4: 3, 2: 4}[max(kept)]
    found = following.second_of(square.f, square.s, square.d, square.mates, square.slots, 1)
    assert found == wanted


@pytest.mark.parametrize("scale", [0.2, 1.0, 5.0])
@pytest.mark.parametrize("shift", [0j, 3 - 2j])
def test_the_second_robot_is_the_same_wherever_and_however_large_the_formation_is(scale: float, shift: complex) -> None:
    m = follower("slot-frame", "l-l")
    places = [1 + 1j, 0.2 + 0.5j, -0.6 + 0.8j, -1 + 0j]  # of the leader, the others, the own
    for k, place in enumerate(places):
        at = scale * place + shift
        m.slots["x"][k], m.slots["y"][k] = at.real, at.imag
    for number, slot in ((2, 1), (3, 2)):
        m.mate(number, 0j, slot=slot, task=FLOCKING)
    lines = [places[3] - place for place in places]
    sines = [abs(np.sin(cmath.phase(lines[0] / lines[k]))) for k in (1, 2)]
    assert sines[0] < 0.1
    assert sines[1] > 0.5
    m.s.least_crossing = 0.5 * 0.5
    assert following.second_of(m.f, m.s, m.d, m.mates, m.slots, 1) == 3
    m.s.least_crossing = 0.5 * (sines[1] + 0.05)
    assert following.second_of(m.f, m.s, m.d, m.mates, m.slots, 1) == -1


def test_a_silent_robot_does_not_end_the_search_for_the_second_one() -> None:
    m = follower("slot-frame", "l-l")
    m.d.slot = 4
    for number, slot, step in ((2, 1, 40), (3, 2, 3), (4, 3, 40)):
        m.mate(number, 0j, slot=slot, step=step, task=FLOCKING)
    assert following.second_of(m.f, m.s, m.d, m.mates, m.slots, 1) == 4
