"""Slots: positions, feasibility, and the slot frame."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.support.crowding import headings, points
from tests.support.reference.score import slots

import posse
from posse.scenarios.formation import FORMATIONS


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
        heading, turned_frame = headings(batch, "world"), points(batch, "world", "frame_cos", "frame_sin")
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
