"""Starts of episodes: random draws, and no overlaps."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy import stats
from tests.support.reference.state import directions, free_gaps, obstacles, one_world, points, positions, snapshot

import posse


@pytest.mark.parametrize("name", posse.scenario_names())
@pytest.mark.parametrize(
    "overrides",
    [{}, {"num_trackers": 64, "breaks": 0}, {"num_trackers": 1, "breaks": 0}, {"target_motion": "agent"}],
    ids=["", "sixty-four", "one", "agent"],
)
def test_everyone_starts_clear_of_everything_at_the_distance_asked_for(name: str, overrides: dict[str, Any]) -> None:
    if overrides.get("num_trackers") == 64 and not posse.get_scenario(name).walled:
        overrides = {**overrides, "start_distance": (1.5, 12.0)}
    batch = posse.batch(name, 20, **overrides)
    s = batch.scenario
    batch.reset(seed=1)
    state = snapshot(batch)
    least, most = s.start_distance
    for e in range(20):
        world = one_world(state, e)
        gaps = free_gaps(s, world)
        gaps[:, s.num_trackers] = np.inf  # the target, for which start_distance counts
        assert gaps.min() > 0.19, "0.2 m but for rounding"
        away = np.hypot(world["tracker_x"] - world["world_x"], world["tracker_y"] - world["world_y"])
        assert away.min() >= least - 1e-4
        assert away.max() <= most + 1e-4
        assert abs(world["world_x"]) <= s.target_extent[0]
        assert abs(world["world_y"]) <= s.target_extent[1]


def test_distance_bearing_and_heading_are_uniform() -> None:
    batch = posse.batch(num_worlds=1000)
    batch.reset(seed=2)
    state = snapshot(batch)
    offset = points(batch, "tracker") - points(batch, "world")[:, None]
    heading, course = directions(batch, "tracker"), directions(batch, "world")
    for shares in (
        (np.abs(offset) - 4) / 6,
        (np.angle(offset) + math.pi) / (2 * math.pi),
        (np.angle(heading) + math.pi) / (2 * math.pi),
        (np.angle(course) + math.pi) / (2 * math.pi),
        (state["world_x"] + 10) / 20,
        (state["world_y"] + 10) / 20,
    ):
        # Trackers that would overlap are drawn again, so the distribution is slightly non-uniform.
        assert stats.kstest(shares.ravel(), "uniform").statistic < 0.035
    assert abs(np.corrcoef(np.angle(heading).ravel(), np.angle(offset).ravel())[0, 1]) < 0.05


@pytest.mark.parametrize(("name", "arena"), [("obstacles", (30.0, 15.0)), ("field", 24.0)])
def test_obstacles_leave_their_gap_between_them_and_to_the_walls(name: str, arena: Any) -> None:
    batch = posse.batch(name, 200, arena=arena)
    s = batch.scenario
    batch.reset(seed=3)
    state = snapshot(batch)
    centres = points(batch, "obstacle")
    radii = state["obstacle_radius"].astype(float)
    count = s.num_obstacles
    gaps = np.abs(centres[:, :, None] - centres[:, None]) - radii[:, :, None] - radii[:, None]
    gaps[:, np.arange(count), np.arange(count)] = np.inf
    assert gaps.min() >= s.obstacle_gap - 1e-4
    for half, along in zip(s.half_sides, (centres.real, centres.imag), strict=True):
        assert half - s.obstacle_gap - 0.5 < (np.abs(along) + radii).max() <= half - s.obstacle_gap + 1e-4
    assert stats.kstest((radii.ravel() - 0.4) / 0.4, "uniform").pvalue > 1e-3


def test_poses_change_the_poses_and_no_other_draw() -> None:
    drawn = posse.batch("field", 4)
    given = posse.batch("field", 4)
    drawn.reset(seed=5)
    state = snapshot(drawn)
    heading = np.arctan2(state["world_heading_sin"], state["world_heading_cos"])
    given.reset(seed=5, options={"target_pose": np.stack([state["world_x"], state["world_y"], heading], axis=-1)})
    for key, value in snapshot(given).items():
        np.testing.assert_allclose(value, state[key], rtol=1e-5, atol=1e-5, err_msg=key)
    actions = np.random.default_rng(0).uniform(-1, 1, drawn.action_shape)
    for _ in range(20):
        np.testing.assert_allclose(drawn.step(actions)[0], given.step(actions)[0], rtol=1e-4, atol=1e-3)


@settings(max_examples=200)
@given(
    x=st.floats(-9.7, 9.7),
    y=st.floats(-9.7, 9.7),
    heading=st.floats(-4.0, 4.0),
    motion=st.sampled_from(["accelerating", "agent"]),
)
def test_a_target_starts_where_it_has_room_to_turn_and_nowhere_else(
    x: float, y: float, heading: float, motion: str
) -> None:
    batch = posse.batch("obstacles", num_trackers=1, target_motion=motion)
    batch.reset(seed=6)
    state = one_world(snapshot(batch), 0)
    centres, radii = obstacles(state)
    place, reach = complex(x, y), 0.6 / 1.8 + 0.15 + 0.1
    room = []
    for side in (1j, -1j):
        centre = place + side * 0.6 / 1.8 * np.exp(1j * heading)
        walls = 10 - max(abs(centre.real), abs(centre.imag))
        room.append(min(walls, float((np.abs(centres - centre) - radii).min())) - reach)
    gaps = np.abs(centres - place) - radii - 0.15
    assume(abs(max(room)) > 2e-3 and gaps.min() > 1e-3)
    assume(abs(positions(state)[0] - place) > 0.5)
    options = {"target_pose": [x, y, heading]}
    if motion == "agent" or max(room) > 0:
        batch.reset(seed=6, options=options)
    else:
        with pytest.raises(ValueError, match="no room to turn"):
            batch.reset(seed=6, options=options)
