"""Eight observers at once: of eight worlds as of one alone, and the nearest mate first."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

import posse

TEAMS: list[dict[str, Any]] = [
    {"num_trackers": 1},
    {"num_trackers": 2},
    {"num_trackers": 5, "message_size": 2},
    {"num_trackers": 8, "sonar_beams": 5},
    {"num_trackers": 9, "num_neighbours": 8, "target_motion": "agent"},
    {"num_trackers": 16, "num_neighbours": 15},
    {"num_trackers": 17, "num_neighbours": 16, "message_size": 1},
    {"num_trackers": 5, "num_neighbours": 2},
    {"num_trackers": 5, "num_neighbours": 7, "message_size": 1},
    {"num_trackers": 8, "num_neighbours": 3, "message_size": 2},
    {"num_trackers": 16, "message_size": 1},
    {"num_trackers": 16, "num_neighbours": 9},
    {"num_trackers": 3, "num_neighbours": 0},
    {"num_trackers": 5, "field_of_view": 2.0, "sensing_range": 9.0},
    {"num_trackers": 64, "num_neighbours": 63},
]
WORLDS = 11  # eight together, and three each alone


@pytest.mark.parametrize("team", TEAMS, ids=str)
def test_worlds_that_are_observed_together_are_as_each_alone(team: dict[str, Any]) -> None:
    make: dict[str, Any] = {**team, "horizon": 31, "num_threads": 1, "seed": 4}
    together = posse.batch("smart", WORLDS, **make)
    alone = [posse.batch("smart", 1, first_world=e, **make) for e in range(WORLDS)]
    rng = np.random.default_rng(0)
    observed = together.reset()
    expected = np.concatenate([world.reset() for world in alone])
    for step in range(40):  # past the horizon, where worlds start anew
        np.testing.assert_array_equal(observed, expected)
        actions = rng.uniform(-1, 1, together.action_shape).astype(np.float32)
        observed = together.step(actions)[0]
        expected = np.concatenate([world.step(actions[e : e + 1])[0] for e, world in enumerate(alone)])
        if step == 12:  # some start anew, in their midst some that are only looked at
            mask = rng.random(WORLDS) < 0.5
            observed = together.reset(options={"reset_mask": mask})
            for e in np.flatnonzero(mask):
                expected[e] = alone[e].reset()[0]


LARGEST = """
import posse, numpy
team = dict(num_trackers=64, num_neighbours=63, start_distance=(4.0, 40.0), num_threads=1)
place = dict(arena=100.0, num_obstacles=60, obstacle_gap=0.3, sonar_beams=64)
for worlds, settings in (
    (1, dict(team, **place, target_motion="agent")),
    (1, dict(team, radio_range=30.0)),
    (8, dict(team, num_trackers=16, num_neighbours=9)),
):
    batch = posse.batch("smart", worlds, **settings)
    batch.reset(seed=1)
    batch.step(numpy.ones(batch.action_shape))
"""


@pytest.mark.long
def test_the_largest_worlds_fit_their_memory() -> None:
    """Compiled code does not check array bounds; plain Python does."""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", LARGEST],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("worlds", [1, 8])
def test_of_mates_as_near_the_lower_number_comes_first(worlds: int) -> None:
    batch = posse.batch("constant", worlds, num_trackers=5)
    # Four at the corners of a square round the last, in no order, and nothing to round.
    corners = [(4.0, -4.0, 0.0), (-4.0, 4.0, 0.0), (4.0, 4.0, 0.0), (-4.0, -4.0, 0.0)]
    poses = np.array([*corners, (0.0, 0.0, 0.0)])
    observed = batch.layout.views(batch.reset(seed=0, options={"tracker_pose": poses}))
    numbers, ranges = observed["neighbour_number"], observed["neighbour_range"]
    assert (ranges[:, 4] == ranges[:, 4, :1]).all()
    orders = [[4, 2, 3, 1], [4, 2, 3, 0], [4, 0, 1, 3], [4, 0, 1, 2], [0, 1, 2, 3]]
    np.testing.assert_array_equal(numbers, np.broadcast_to(orders, numbers.shape))
