"""The radio: delay, relaying, and the shortcut for a perfect one; the rest is in test_random_worlds."""

from __future__ import annotations

import numpy as np
import pytest

import posse


@pytest.mark.parametrize("delay", [0, 1, 4])
def test_what_is_said_arrives_after_exactly_the_delay(delay: int) -> None:
    batch = posse.batch(num_trackers=2, radio_delay=delay, radio_range=1e4, message_size=1)
    batch.reset(seed=0)
    for step in range(1, 12):
        observations = batch.step(np.full(batch.action_shape, step / 100, np.float32))[0]
        mates = batch.layout.views(observations)
        if step >= delay:
            # What was sent at the start, before anything could be said, holds zeros.
            np.testing.assert_allclose(mates["neighbour_message"][0], (step - delay) / 100)
            np.testing.assert_allclose(mates["neighbour_age"][0], delay * 0.1, rtol=1e-5, atol=1e-6)
        else:
            assert (mates["neighbour_number"] == -1).all()


def test_a_fix_goes_from_hop_to_hop_and_keeps_its_time() -> None:
    """A chain of four of which only the first sees the target; each hop takes delay plus a step."""
    batch = posse.batch(
        num_trackers=4, sensing_range=3.0, radio_range=4.5, radio_delay=2, target_speed=0.0, start_distance=(1.0, 16.0)
    )
    batch.reset(options={"target_pose": [0, 0, 0], "tracker_pose": [[2, 0, 0], [6, 0, 0], [10, 0, 0], [14, 0, 0]]})
    for step in range(1, 14):
        observations = batch.step(np.tile([-1.0, 0.0], (1, 4, 1)))[0]
        fixes = batch.state["tracker_fix_step"][0]
        # Said at step k, a fix is heard at k + 2, and passed on with the next broadcast, k + 3.
        assert fixes.tolist() == [max(-1, step - lag) if step >= lag else -1 for lag in (0, 2, 5, 8)]
        views = batch.layout.views(observations)
        known = fixes >= 0
        np.testing.assert_allclose(views["target_age"][0][known], 0.1 * (step - fixes[known]), rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose(views["target_range"][0][known], 2 + 4 * np.flatnonzero(known))
        assert views["target_seen"][0].tolist() == [1, 0, 0, 0]


@pytest.mark.parametrize("name", ["constant", "search", "leader-loss"])
def test_a_radio_without_limits_is_one_with_a_huge_range(name: str) -> None:
    """The shortcut for a perfect radio changes results only by rounding."""
    without = posse.batch(name, 6, message_size=2, horizon=120, range_noise=0.02)
    huge = posse.batch(name, 6, message_size=2, horizon=120, range_noise=0.02, radio_range=9e3)
    np.testing.assert_allclose(without.reset(seed=3), huge.reset(seed=3), rtol=1e-5, atol=2e-5)
    rng = np.random.default_rng(3)
    for _ in range(120):
        actions = rng.uniform(-1, 1, without.action_shape)
        for mine, theirs in zip(without.step(actions)[:2], huge.step(actions)[:2], strict=True):
            np.testing.assert_allclose(mine, theirs, rtol=1e-5, atol=2e-5)
