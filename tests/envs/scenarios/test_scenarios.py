"""The named scenarios: versions, what docs/scenarios.md states of them, and the slots of formations."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest
from tests.support.adapters import part
from tests.support.reference.score import slots
from tests.support.reference.state import directions, points

import posse
from posse.scenarios import get_scenario, scenario_names
from posse.scenarios.scenario import FORMATIONS

# A version rises when the behaviour of a named scenario changes, and only then.
VERSIONS = {
    "constant": 1,
    "accelerating": 2,
    "smart": 1,
    "search": 3,
    "obstacles": 2,
    "radio": 2,
    "leader-loss": 2,
    "field": 3,
    "duel": 3,
    "robots": 1,
    "paper-centralized": 1,
    "paper-distributed": 1,
}


def test_the_names_and_versions_are_the_published_ones() -> None:
    assert {name: get_scenario(name).version for name in scenario_names()} == VERSIONS


@functools.cache
def started(name: str) -> posse.Batch:
    batch = posse.batch(name, 200, seed=5)
    batch.reset()
    return batch


@pytest.mark.parametrize("name", scenario_names())
def test_it_plays_to_its_horizon(name: str) -> None:
    s = get_scenario(name)
    batch = posse.batch(name, num_worlds=6, seed=5, autoreset="disabled")
    batch.reset()
    (low, high), rng = batch.layout.bounds(), np.random.default_rng(0)
    for step in range(1, s.horizon + 1):
        # Wandering: full speed, a turn that changes now and then.
        if step % 15 == 1:
            turn = rng.uniform(-1, 1, batch.action_shape[:2]).astype(np.float32)
        actions = np.stack([np.full_like(turn, 0.8), turn], -1)
        observations, _, terminated, truncated, infos = batch.step(actions)
        assert ((observations >= low) & (observations <= high)).all()
        assert not terminated.any()
        assert truncated.all() == (step == s.horizon)
    metrics = part(infos, "metrics/")
    assert ((metrics["score"] >= 0) & (metrics["score"] <= metrics["bound"] + 1e-6)).all()
    broken = (batch.state["tracker_broken_at"] < s.horizon).sum(axis=1)
    assert (broken == s.breaks).all()
    # With a bound near 0 or at 1 a scenario could not distinguish teams.
    assert 0.6 < metrics["bound"].mean() < 0.99


def test_obstacles_stand_in_the_view() -> None:
    # Sight is unlimited: only obstacles hide the target.
    assert 0.1 < (started("obstacles").state["tracker_sees"] == 0).mean() < 0.6
    assert not started("search").state["tracker_sees"].any(), "there sight is short"


def test_in_radio_some_trackers_depend_on_messages_and_nearly_all_are_in_range() -> None:
    batch = started("radio")
    sees = batch.state["tracker_sees"] != 0
    assert sees.any(axis=1).mean() > 0.98
    assert (~sees).mean() > 0.2
    idle = np.zeros(batch.action_shape, np.float32)
    idle[..., 0] = -1
    for _ in range(20):
        batch.step(idle)
    assert (batch.state["tracker_fix_step"] >= 0).mean() > 0.95


def test_in_leader_loss_the_leader_alone_sees_the_target_from_its_slot() -> None:
    s = get_scenario("leader-loss")
    distances = sorted(math.hypot(x, y) for x, y in s.slot_offsets)
    assert distances[0] + s.tolerance < s.sensing_range < distances[1] - s.tolerance
    # At the start everyone does, so that nothing but the loss is tested.
    assert s.start_distance[1] < s.sensing_range
    assert started("leader-loss").state["tracker_sees"].all()


def test_the_paper_is_one_set_up_under_two_names() -> None:
    centralized, distributed = get_scenario("paper-centralized"), get_scenario("paper-distributed")
    assert centralized.replace(name="paper-distributed") == distributed
    assert (centralized.num_trackers, centralized.target_motion) == (5, "constant")


def test_the_target_of_robots_is_a_robot_of_the_same_kind() -> None:
    s = get_scenario("robots")
    wheel = s.target_speed + s.target_turn_rate * s.wheel_base / 2
    assert 0.98 * s.tracker_speeds[0] < wheel <= s.tracker_speeds[0], "as fast as its wheels can"


@pytest.mark.parametrize("formation", FORMATIONS)
@pytest.mark.parametrize("number", [1, 2, 3, 4, 5, 8, 13, 64])
def test_slots_are_where_their_definition_says_and_apart(formation: str, number: int) -> None:
    scenario = posse.get_scenario("constant", num_trackers=number, formation=formation)
    places = np.array([complex(*offset) for offset in scenario.slot_offsets])
    np.testing.assert_allclose(places, slots(scenario), rtol=1e-9, atol=1e-9)
    between = np.abs(places[:, None] - places[None, :]) + np.diag(np.full(number, np.inf))
    assert between.min() > 2 * scenario.tolerance
    if number > 1:
        assert between.min() == pytest.approx(scenario.formation_spacing, rel=1e-6) or (formation == "ring")
    assert np.abs(places).min() >= scenario.formation_distance - 1e-12
    if formation != "ring":
        assert places.real.max() <= -scenario.formation_distance + 1e-12, "behind the target"


@pytest.mark.parametrize("formation", FORMATIONS)
@pytest.mark.parametrize("motion", ["accelerating", "smart", "agent"])
def test_every_slot_can_be_followed_without_reversing(formation: str, motion: str) -> None:
    batch = posse.batch(num_worlds=4, formation=formation, target_motion=motion, num_trackers=8, horizon=300)
    s = batch.scenario
    batch.reset(seed=1)
    places, most = slots(s), 0.1 * s.slot_turn_rate
    turned, rng = 0.0, np.random.default_rng(1)
    for k in range(300):
        if k % 20 == 0:
            actions = rng.choice([-1.0, 1.0], batch.action_shape)
            actions[:, -1, 0] = 1.0
        frame = points(batch, "world", "frame_cos", "frame_sin")
        batch.step(actions)
        heading, turned_frame = directions(batch, "world"), points(batch, "world", "frame_cos", "frame_sin")
        # The frame turns towards the heading, at its limit until it is there.
        turn, error = np.angle(turned_frame / frame), np.angle(heading / frame)
        either = np.abs(error) > 3.1
        np.testing.assert_allclose(turn[~either], np.clip(error, -most, most)[~either], rtol=1e-5, atol=1e-5)
        turned = max(turned, float(np.abs(turn).max()))
        if motion != "agent":
            # The velocity of every slot, ahead and aside: never faster than a tracker, never backwards.
            carried = s.target_speed + (1j * turn / 0.1 * turned_frame / heading)[:, None] * places
            assert (np.abs(carried) <= min(s.tracker_speeds)).all()
            assert (carried.real >= -1e-5).all()
    assert turned == pytest.approx(most, rel=1e-3), "the limit was reached"


def test_the_slot_turn_rate_is_the_one_designed() -> None:
    s = posse.get_scenario("constant", tracker_speed=1.0, target_speed=0.6)
    farthest = abs(complex(-1.2 - 2 * 1.2 * math.sqrt(0.5), 2 * 1.2 * math.sqrt(0.5)))
    assert s.slot_turn_rate == pytest.approx(0.8 * 0.4 / farthest)
    slow = s.replace(target_speed=0.1)
    assert slow.slot_turn_rate == pytest.approx(0.1 / farthest)
