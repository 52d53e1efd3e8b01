"""A control step of one tracker: which parts it calls, and what it writes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from tests.support.minds import Mind, turn
from tests.support.plain import plain

controller, correction = plain("ddcs.controller"), plain("ddcs.correction")
heading, safeguard = plain("laws.heading"), plain("laws.safeguard")
slots, tracking = plain("ddcs.tracking.slots"), plain("ddcs.tracking.motion")
OUTERMOST = 3.0


class Turn:
    """One tracker's work space."""

    def __init__(self, m: Mind) -> None:
        self.m = m
        self.body = np.zeros(1, heading.BODY)[0]
        self.plays = np.zeros(1, safeguard.PLAYS)[0]
        self.discs = np.zeros(32, safeguard.DISC)

    def plan(self) -> None:
        m, n = self.m, self.m.n
        controller.plan(
            m.f, m.s, m.slots, OUTERMOST, m.d, m.mates, m.seen, m.o, np.zeros((n, n)), np.zeros((7, n + 1)), self.body
        )

    def carry_out(self) -> Any:
        m, action = self.m, np.zeros(7, np.float32)
        controller.carry_out(
            m.f, m.s, m.slots, m.d, m.mates, m.o, m.memory.beams, self.discs, self.body, self.plays, action
        )
        return action


def sees(m: Mind, target: complex, theta: float = 0.0) -> None:
    """The own sensor has the target."""
    own = complex(m.o[m.f.position], m.o[m.f.position + 1])
    facing = complex(m.o[m.f.heading], m.o[m.f.heading + 1])
    way = (target - own) / facing
    m.fill(
        target_known=1,
        target_seen=1,
        target_age=0,
        target_range=abs(way),
        target_bearing=way / abs(way),
        target_heading=turn(theta) / facing,
        target_frame=turn(theta) / facing,
    )


def standing(scenario: str = "constant", at: complex = 1 - 2j, theta: float = 0.4, **played: Any) -> Turn:
    m = Mind(scenario, own=1, played=played)
    m.stand(at, theta)
    return Turn(m)


def test_a_tracker_that_knows_its_target_goes_to_its_slot() -> None:
    t = standing()
    m, d = t.m, t.m.d
    sees(m, 5 + 1j, 0.3)
    m.mate(0, 3 + 1j, step=0)
    t.plan()
    assert (d.task, d.known) == (1, 1)
    cost, work = np.zeros((5, 5)), np.zeros((7, 6))
    chosen, d.slot = d.slot, -1
    facing = turn(0.4)
    slots.choose_slot(m.f, m.s, d, m.mates, m.slots, 1, 1.0, -2.0, facing.real, facing.imag, 1.0, 2.0, cost, work)
    assert d.slot == chosen
    place = complex(d.now_x, d.now_y) + m.slot(chosen) * turn(0.3)
    assert d.error == pytest.approx(abs(place - (1 - 2j)), abs=1e-4)
    wanted = tracking.wanted_motion(m.f, m.s, d, m.mates, m.slots, 1, 1.0, -2.0, t.body)
    assert (d.wish_x, d.wish_y, d.wish_speed, d.wish_omega) == pytest.approx(wanted)
    action = t.carry_out()
    assert d.step == 1
    assert action[0] == pytest.approx(min(1.0, 2.0 * wanted[2] - 1.0), abs=1e-5)
    assert action[1] == pytest.approx(max(-1.0, min(1.0, wanted[3] / 2.0)), abs=1e-5)
    assert action[2:].tolist() == [(w + 1) / 512 for w in (1, d.leader, d.term, d.pulse, chosen)]


@pytest.mark.parametrize("away", [1, 2, 3, 4])
def test_slots_are_planned_anew_every_half_second(away: int) -> None:
    t = standing()
    m, d = t.m, t.m.d
    sees(m, 5 + 1j)
    t.plan()
    best = int(d.slot)
    other = (best + away) % 5
    for step, kept in ((1, True), (4, True), (5, False), (6, True), (10, False)):
        d.step, d.slot = step, other
        m.s.loyalty = 0.0
        t.plan()
        assert (d.slot == other) == kept
        d.step, d.slot = 6, -1
        t.plan()
        assert d.slot == best


@pytest.mark.parametrize("dt", [0.1, 1.0])
def test_slots_are_planned_anew_in_every_step_at_the_least(dt: float) -> None:
    t = standing(replan_time=0.1, loyalty=0.0)
    t.m.f.dt = dt
    sees(t.m, 5 + 1j)
    t.plan()
    best = int(t.m.d.slot)
    for step in (1, 2):
        t.m.d.step, t.m.d.slot = step, (best + 2) % 5
        t.plan()
        assert t.m.d.slot == best


def test_the_first_slot_is_taken_up_like_others() -> None:
    t = standing("field", at=1 - 2j)
    m, d = t.m, t.m.d
    sees(m, 4 + 1j)
    d.slot, d.task, d.step = 0, 1, 1
    t.plan()
    assert (d.slot, d.goal_step) == (0, -1)
    wanted = tracking.wanted_motion(m.f, m.s, d, m.mates, m.slots, 1, 1.0, -2.0, t.body)
    assert (d.wish_x, d.wish_y, d.wish_speed, d.wish_omega) == pytest.approx(wanted)


def test_one_that_may_not_search_looks_for_its_lost_target_too() -> None:
    t = standing("field", at=1 - 2j, forbidden=("converging>searching",))
    d = t.m.d
    d.task, d.slot, d.step = 1, 3, 7
    t.plan()
    assert (d.task, d.slot, d.goal_step) == (1, -1, 7)
    way = complex(d.goal_x, d.goal_y) - (1 - 2j)
    assert complex(d.wish_x, d.wish_y) == pytest.approx(way / abs(way), abs=1e-6)


@pytest.mark.parametrize("theta", [1.9, -1.3])
def test_a_search_begins_ahead_and_straight(theta: float) -> None:
    t = standing("field", at=0j, theta=theta, turn_weight=5.0)
    t.m.f.sight = 2.0
    t.plan()
    d = t.m.d
    goal = complex(d.goal_x, d.goal_y)
    assert (goal / abs(goal) / turn(theta)).real > 0.9
    t.m.stand(0j, math.atan2(goal.imag, goal.real))
    d.step = 1
    t.plan()
    assert complex(d.goal_x, d.goal_y) == goal
    assert (d.wish_speed, d.wish_omega) == pytest.approx((1.0, 0.0), abs=1e-4)


def test_a_tracker_without_an_estimate_searches() -> None:
    t = standing("field", at=2 + 1j)
    m, d = t.m, t.m.d
    d.task, d.slot, d.closing, d.step, d.goal_step = 1, 3, 1, 20, 15
    t.plan()
    assert (d.task, d.slot, d.error, d.closing) == (0, -1, -1.0, 0)
    assert d.lost_step == 20
    assert d.goal_step == 20
    way = complex(d.goal_x, d.goal_y) - (2 + 1j)
    assert complex(d.wish_x, d.wish_y) == pytest.approx(way / abs(way), abs=1e-6)
    assert (d.wish_speed, d.wish_omega) == pytest.approx(heading.regulate(t.body, d.wish_x, d.wish_y, 0.0))
    assert (m.seen == 21).any()
    d.step = 25
    t.plan()
    assert (d.lost_step, d.goal_step) == (20, 20)  # still the same search


def test_a_search_that_may_not_end_goes_on_without_a_slot_too() -> None:
    t = standing(forbidden=("searching>converging", "searching>flocking"))
    t.m.f.sight = 4.0
    sees(t.m, 5 + 1j)
    t.plan()
    assert t.m.d.task == 0
    assert t.m.d.goal_step == 0


def test_in_the_centralized_model_there_is_a_leader_at_once() -> None:
    for model, leader in (("centralized", 1), ("distributed", -1)):
        t = standing(model=model)
        sees(t.m, 5 + 1j)
        t.plan()
        assert t.m.d.leader == leader


def test_the_safeguard_turns_away_from_what_is_near() -> None:
    t = standing(at=0j, theta=0.0)
    m, d = t.m, t.m.d
    sees(m, 6 + 0j)
    t.plan()
    free = t.carry_out()
    m.mate(0, 0.7 + 0j, step=d.step, slot=4)
    t.plan()
    m.mate(0, 0.7 + 0j, step=d.step, slot=4)
    wish = d.wish_x, d.wish_y
    kept = t.carry_out()
    vx, vy, changed = safeguard.safe_velocity(t.body, t.discs, 1, *wish, t.plays)
    assert changed
    speed, omega = heading.regulate(t.body, vx, vy, 0.0)
    assert kept[:2] == pytest.approx([2 * speed - 1, np.clip(omega / 2, -1, 1)], abs=1e-5)
    assert abs(kept - free)[:2].max() > 0.1


def test_a_command_that_is_safe_is_carried_out_as_it_is() -> None:
    t = standing()
    d = t.m.d
    controller.feel_body(t.m.f, t.m.o, t.body)
    for clearance in (0.0, 0.3):
        t.m.s.detour = clearance  # with nothing to go round
        d.wish_x, d.wish_y, d.wish_speed, d.wish_omega = 0.3, 0.4, 0.8, -0.5
        assert t.carry_out()[:2] == pytest.approx([0.6, -0.25])


@pytest.mark.parametrize("theta", [0.0, 0.7])
def test_an_echo_is_where_the_beam_points(theta: float) -> None:
    t = standing(at=1 - 2j, theta=theta)
    controller.feel_body(t.m.f, t.m.o, t.body)
    t.m.o[t.m.f.sonar] = 1.0
    t.carry_out()
    at = complex(t.discs[0].x, t.discs[0].y)
    assert at == pytest.approx((1.0 + 0.15 + 0.46) * turn(theta), abs=1e-6)


@pytest.mark.parametrize("theta", [0.0, 0.7])
def test_a_team_mate_and_a_wall_are_where_they_are(theta: float) -> None:
    t = standing("field", at=10 - 2j, theta=theta)
    controller.feel_body(t.m.f, t.m.o, t.body)
    t.m.mate(0, 11 - 2.5j)
    t.carry_out()
    found = [complex(t.discs[k].x, t.discs[k].y) for k in (0, 1)]
    assert found == pytest.approx([1 - 0.5j, float(t.m.f.extent) - 10 - 0.15 + 1000], rel=1e-6)


@pytest.mark.parametrize(("clearance", "task"), [(0.0, 1), (0.3, 1), (0.3, 2)])
def test_a_detour_turns_the_way_before_the_safeguard(clearance: float, task: int) -> None:
    t = standing(at=0j, theta=0.0, detour=clearance)
    m, d = t.m, t.m.d
    m.fill(speed=1.0)
    controller.feel_body(m.f, m.o, t.body)
    d.task, d.step = task, 30
    d.wish_x, d.wish_y, d.wish_speed, d.wish_omega = 1.0, 0.0, 1.0, 0.0
    m.o[m.f.sonar] = 1.9 - 0.02  # an obstacle far ahead
    action = t.carry_out()
    turned = clearance > 0.0 and task == 1
    assert (d.side != 0) == turned
    if turned:
        reach = 0.5 + 0.15 + 0.3
        angle = math.asin(reach / (1.88 + 0.15 + 0.5))
        assert abs(action[1]) == pytest.approx(min(1.0, angle / 0.1 / 2.0), abs=1e-3)
        assert abs(d.side) == 1


def test_a_corrected_step_without_a_correction_is_the_step() -> None:
    actions = []
    for share in (None, 0j, 0.3 - 0.2j):
        t = standing()
        sees(t.m, 5 + 1j, 0.3)
        t.plan()
        if share is not None:
            correction.correct(t.m.d, t.body, share.real, share.imag)
        actions.append(t.carry_out())
    np.testing.assert_array_equal(actions[0], actions[1])
    assert abs(actions[2] - actions[0]).max() > 0.05


def test_halves_and_whole_play_the_same_and_restart_forgets() -> None:
    m = Mind("field", own=1)
    policy, layout = m.policy, m.layout
    rng = np.random.default_rng(0)
    observations = np.tile(m.o, (2, 5, 1))
    for e in range(2):
        for i in range(5):
            m.stand(complex(*rng.normal(0, 2, 2)), rng.uniform(-3, 3))
            sees(m, 3 + 1j)
            m.fill(number=i)
            observations[e, i] = m.o
    whole, parts = policy.begin(layout, 2), policy.begin(layout, 2)
    for _ in range(2):
        actions, whole = policy.act(observations, whole)
        proposals, parts = policy.propose(observations, parts)
        wish = parts.minds["wish_x"] + 1j * parts.minds["wish_y"]
        facing = observations[..., m.f.heading] + 1j * observations[..., m.f.heading + 1]
        np.testing.assert_allclose(proposals[..., 0] + 1j * proposals[..., 1], wish / facing, atol=1e-5)
        carried, parts = policy.carry_out(observations, parts, np.zeros((2, 5, 2)))
        np.testing.assert_array_equal(actions, carried)
    for name, array in policy.arrays(whole).items():
        if name.startswith("minds") and "wish" not in name:
            np.testing.assert_array_equal(array, policy.arrays(parts)[name])
    assert (whole.minds["step"] == 2).all()
    assert {"seen", "minds.step", "mates.step"} <= set(policy.arrays(whole))
    shares = rng.uniform(-0.5, 0.5, (2, 5, 2)).astype(np.float32)
    single = np.zeros((2, 5, 7), np.float32)
    copies = parts.minds.copy(), parts.mates.copy()
    for e in range(2):
        for i in range(5):
            t = Turn(m)
            m.d, m.mates, m.o = copies[0][e, i], copies[1][e, i], observations[e, i]
            controller.feel_body(m.f, m.o, t.body)
            correction.correct(m.d, t.body, *(float(share) for share in shares[e, i]))
            single[e, i] = t.carry_out()
    np.testing.assert_array_equal(policy.carry_out(observations, parts, shares)[0], single)
    assert abs(single - carried).max() > 0.1
    fresh, begun = policy.arrays(policy.begin(layout, 2)), policy.arrays(whole)
    before = {name: array.copy() for name, array in begun.items()}
    policy.restart(whole, np.array([False, True]))
    for name, array in begun.items():
        np.testing.assert_array_equal(array[0], before[name][0])
        np.testing.assert_array_equal(array[1], fresh[name][1])
    minds, mates = whole.minds[1, 0], whole.mates[1, 0, 0]
    assert [minds[k] for k in ("fix_step", "slot", "leader", "goal_step", "lost_step", "error")] == [-1] * 6
    assert [mates[k] for k in ("step", "task", "leader", "term", "pulse", "slot")] == [-1] * 6
    assert minds["step"] == minds["term"] == minds["known"] == mates["x"] == 0
    notes = policy.annotations(whole)
    np.testing.assert_array_equal(notes["estimate_age"][1], -1.0)
    np.testing.assert_array_equal(notes["estimate_age"][0], whole.minds["age"][0])
    np.testing.assert_array_equal(notes["estimate"][0, :, 1], whole.minds["now_y"][0])
