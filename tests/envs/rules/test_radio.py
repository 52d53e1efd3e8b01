"""The radio: range, delay, loss, outages; what is relayed and when."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.support.reference.recordings import CASES, case_name, record
from tests.support.reference.senses import Senses

import posse


@pytest.mark.parametrize("case", CASES, ids=case_name)
def test_fixes_and_what_was_heard_equal_an_independent_working(case: Any) -> None:
    recording = record(*case)
    s, senses = recording.scenario, Senses(recording.scenario)
    n = s.num_trackers
    heard = 0
    for step, state in enumerate(recording.states):
        senses.follow(state, recording.actions[step - 1] if step else None)
        assert state["tracker_sees"].astype(bool).tolist() == senses.sees
        for i, fix in enumerate(senses.fixes):
            assert state["tracker_fix_step"][i] == fix.step
            if fix.step >= 0:
                t = {
                    k: complex(state[f"tracker_fix_{k[0]}"][i], state[f"tracker_fix_{k[1]}"][i])
                    for k in (("x", "y"), ("cos", "sin"), ("vx", "vy"))
                }
                assert t["x", "y"] == pytest.approx(fix.place, rel=1e-4, abs=1e-4)
                assert t["cos", "sin"] == pytest.approx(fix.heading, rel=1e-4, abs=1e-4)
                assert t["vx", "vy"] == pytest.approx(fix.velocity, rel=1e-4, abs=2e-3)
        if "heard_step" in state and state["heard_step"].shape == (n, n):
            for i in range(n):
                for j in range(n):
                    words = senses.heard.get((i, j))
                    assert state["heard_step"][i, j] == (words.step if words else -1)
                    if words:
                        heard += 1
                        place = complex(state["heard_x"][i, j], state["heard_y"][i, j])
                        assert place == pytest.approx(words.place, rel=1e-6, abs=1e-6)
                        np.testing.assert_array_equal(state["heard_message"][i, j], words.message.astype(np.float32))
    assert heard > 0 or state["heard_step"].size == 0


@pytest.mark.parametrize("delay", [0, 1, 4])
def test_what_is_said_arrives_after_exactly_the_delay(delay: int) -> None:
    batch = posse.batch(num_trackers=2, radio_delay=delay, radio_range=1e4, message_size=1)
    batch.reset(seed=0)
    for step in range(1, 12):
        said = step / 100
        actions = np.full(batch.action_shape, said, np.float32)
        observations = batch.step(actions)[0]
        mates = batch.layout.views(observations)
        if step >= delay:
            # What was sent at the start, before anything could be said, holds zeros.
            expected = (step - delay) / 100
            np.testing.assert_allclose(mates["neighbour_message"][0], expected)
            np.testing.assert_allclose(mates["neighbour_age"][0], delay * 0.1, rtol=1e-5, atol=1e-6)
        else:
            assert (mates["neighbour_number"] == -1).all()


def test_an_outage_is_silent_both_ways() -> None:
    batch = posse.batch(num_worlds=50, num_trackers=3, radio_outages=0.5, outage_time=2.0, horizon=80)
    batch.reset(seed=2)
    silent = 0
    for step in range(1, 80):
        batch.step(np.full(batch.action_shape, -1.0))
        dead_from = batch.state["tracker_radio_dead_from"]
        alive = (step < dead_from) | (step >= dead_from + 20)
        link = alive[:, :, None] & alive[:, None, :] & ~np.eye(3, dtype=bool)
        np.testing.assert_array_equal(batch.state["heard_step"] == step, link)
        silent += int((~alive).sum())
    assert silent > 500


def test_a_fix_goes_from_hop_to_hop_and_keeps_its_time() -> None:
    """A chain of four of which only the first sees the target; each hop takes delay plus a step."""
    batch = posse.batch(
        num_trackers=4, sensing_range=3.0, radio_range=4.5, radio_delay=2, target_speed=0.0, start_distance=(1.0, 16.0)
    )
    batch.reset(options={"target_pose": [0, 0, 0], "tracker_pose": [[2, 0, 0], [6, 0, 0], [10, 0, 0], [14, 0, 0]]})
    stay = np.tile([-1.0, 0.0], (1, 4, 1))
    for step in range(1, 14):
        observations = batch.step(stay)[0]
        fixes = batch.state["tracker_fix_step"][0]
        # Said at step k, a fix is heard at k + 2, and passed on with the next broadcast, k + 3.
        assert fixes.tolist() == [max(-1, step - lag) if step >= lag else -1 for lag in (0, 2, 5, 8)]
        views = batch.layout.views(observations)
        known = fixes >= 0
        np.testing.assert_allclose(views["target_age"][0][known], 0.1 * (step - fixes[known]), rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(views["target_range"][0][known], 2 + 4 * np.flatnonzero(known))
        assert views["target_seen"][0].tolist() == [1, 0, 0, 0]


@pytest.mark.parametrize("name", ["constant", "accelerating", "smart", "search", "leader-loss"])
def test_a_radio_without_limits_is_one_with_a_huge_range(name: str) -> None:
    """The engine's shortcut for a perfect radio changes results only by rounding."""
    without = posse.batch(name, 6, message_size=2, horizon=120, range_noise=0.02)
    huge = posse.batch(name, 6, message_size=2, horizon=120, range_noise=0.02, radio_range=9e3)
    np.testing.assert_allclose(without.reset(seed=3), huge.reset(seed=3), rtol=1e-5, atol=2e-5)
    rng = np.random.default_rng(3)
    for _ in range(120):
        actions = rng.uniform(-1, 1, without.action_shape)
        for mine, theirs in zip(without.step(actions)[:4], huge.step(actions)[:4], strict=True):
            np.testing.assert_allclose(
                np.asarray(mine, np.float32), np.asarray(theirs, np.float32), rtol=1e-5, atol=2e-5
            )


def test_the_graph_is_connected_over_hops() -> None:
    chain = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [8.0, 0.0, 0.0]]
    for middle, share in ((4.0, 1.0), (3.5, 0.0)):
        chain[1][0] = middle
        batch = posse.batch(num_trackers=3, radio_range=4.2, start_distance=(1.0, 20.0))
        batch.reset(options={"target_pose": [0, -9, 0], "tracker_pose": chain})
        for _ in range(3):
            batch.step(np.tile([-1.0, 0.0], (1, 3, 1)))
        assert batch.metrics()["time_connected"][0] == share
