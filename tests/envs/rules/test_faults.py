"""Faults: who breaks and when, and what a broken tracker still does."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from tests.support.crowding import points
from tests.support.reference.state import NEVER, snapshot

import posse


def broken(batch: posse.Batch) -> np.ndarray:
    return np.asarray(batch.state["tracker_broken_at"] != NEVER)


@pytest.mark.parametrize("number", [1, 4])
def test_drawn_trackers_break_at_drawn_times(number: int) -> None:
    batch = posse.batch(
        num_worlds=300, breaks=number, break_choice="drawn", break_window=(0.3, 0.7), horizon=100, autoreset="disabled"
    )
    batch.reset(seed=1)
    for _ in range(100):
        batch.step(np.zeros(batch.action_shape))
        assert (batch.state["world_working"] == 5 - broken(batch).sum(axis=1)).all()
    at = batch.state["tracker_broken_at"]
    assert (broken(batch).sum(axis=1) == number).all()
    times = at[at != NEVER]
    assert times.min() >= 30
    assert times.max() < 70
    assert abs(times.mean() - 49.5) < 4 * 40 / math.sqrt(12 * len(times))
    each = (at != NEVER).mean(axis=0)
    assert np.abs(each - number / 5).max() < 4 * math.sqrt(0.25 / 300), "no number is spared"


def test_the_nearest_to_the_target_break_one_after_the_other_within_the_window() -> None:
    batch = posse.batch("leader-loss", 100, breaks=3, break_window=(0.2, 0.6), autoreset="disabled", horizon=100)
    batch.reset(seed=3)
    rng = np.random.default_rng(2)
    for _ in range(100):
        away, was_broken = np.abs(points(batch, "tracker") - points(batch, "world")[:, None]), broken(batch)
        batch.step(rng.uniform(-1, 1, batch.action_shape))
        for e in np.flatnonzero((broken(batch) & ~was_broken).any(axis=1)):
            new = np.flatnonzero(broken(batch)[e] & ~was_broken[e])
            assert new.tolist() == [np.where(was_broken[e], np.inf, away[e]).argmin()]
    times = np.sort(batch.state["tracker_broken_at"], axis=1)
    assert (times[:, 3:] == NEVER).all()
    assert (times[:, 0] >= 20).all()
    assert (np.diff(times[:, :3], axis=1) >= 1).all(), "one at a time"
    assert (times[:, 2] <= 62).all(), "the window is not left, but for a step each"
    assert np.ptp(times[:, 0]) > 25, "the first is drawn from all of the window"


def test_a_broken_tracker_stops_is_silent_and_ignores_its_actions() -> None:
    settings: dict[str, Any] = {"break_window": (0.1, 0.1), "horizon": 60, "message_size": 1}
    batch, twin = posse.batch("leader-loss", 10, **settings), posse.batch("leader-loss", 10, **settings)
    batch.reset(seed=4)
    twin.reset(seed=4)
    rng = np.random.default_rng(4)
    for step in range(1, 60):
        actions = rng.uniform(-1, 1, batch.action_shape).astype(np.float32)
        others = actions.copy()
        others[broken(batch)] = rng.uniform(-1, 1, 3)
        before = snapshot(batch)
        observations, *_ = batch.step(actions)
        np.testing.assert_array_equal(observations, twin.step(others)[0])
        views = batch.layout.views(observations)
        np.testing.assert_array_equal(views["working"] == 0, broken(batch))
        if step < 8:
            continue
        for key in ("x", "y", "heading_cos", "heading_sin"):
            np.testing.assert_array_equal(
                batch.state[f"tracker_{key}"][broken(batch)], before[f"tracker_{key}"][broken(batch)]
            )
        for key in ("speed", "turn_rate", "target_seen"):
            assert (views[key][broken(batch)] == 0).all()
        # Its team-mates receive no more messages: the last one ages, then is dropped.
        number = np.flatnonzero(broken(batch)[0])[0]
        mate = 0 if number else 1
        heard = views["neighbour_number"][0, mate] == number
        silent = 0.1 * (step - 6)
        if silent <= batch.scenario.forget_after + 1e-6:
            assert views["neighbour_age"][0, mate][heard] == pytest.approx(silent)
        else:
            assert not heard.any()
