"""The radio: delay, relaying, and the shortcut for a perfect one; the rest is in test_random_worlds."""

from __future__ import annotations

import numpy as np

import posse


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
