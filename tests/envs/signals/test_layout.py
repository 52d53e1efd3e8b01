"""The observation: fields against an independent computation, bounds, layout."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.reference.senses import sonar
from tests.support.reference.state import headings, one_world, positions, snapshot

import posse


def test_what_the_target_agent_is_given() -> None:
    batch = posse.batch("obstacles", 6, target_motion="agent", num_trackers=4, num_neighbours=6)
    s = batch.scenario
    observations = batch.reset(seed=2)
    rng = np.random.default_rng(2)
    for _ in range(20):
        views = batch.layout.views(observations)
        state = snapshot(batch)
        for e in range(6):
            world = one_world(state, e)
            mine = {name: view[e, 4] for name, view in views.items()}
            p, h = positions(world), headings(world)
            assert mine["number"] == -1
            assert mine["target_known"] == 0
            assert mine["target_age"] == mine["target_range"] == -1
            assert mine["max_speed"] == np.float32(s.target_speed)
            assert mine["max_turn_rate"] == np.float32(s.target_turn_rate)
            assert mine["acceleration_time"] == 0, "an agent's limits act at once"
            np.testing.assert_allclose(mine["sonar"], sonar(s, world, 4), rtol=1e-4, atol=2e-3)
            away = (p[:4] - p[4]) / h[4]
            at = mine["neighbour_bearing"][:4] @ [1, 1j] * mine["neighbour_range"][:4]
            order = [int(number) for number in mine["neighbour_number"][:4]]
            assert sorted(order) == [0, 1, 2, 3]
            np.testing.assert_allclose(at, away[order], rtol=1e-4, atol=1e-4)
            assert (np.diff(mine["neighbour_range"][:4]) >= 0).all(), "nearest first"
            assert mine["neighbour_number"][4:].tolist() == [-1, -1]
            assert mine["neighbour_range"][4:].tolist() == [-1, -1]
            assert (mine["neighbour_heading"][4:] == 0).all()
        observations = batch.step(rng.uniform(-1, 1, batch.action_shape))[0]


def test_the_target_agent_feels_a_wall() -> None:
    batch = posse.batch(target_motion="agent", num_trackers=1, arena=10.0, start_distance=(1, 9))
    batch.reset(options={"target_pose": [4.5, 0, 0], "tracker_pose": [[0, 0, 0]]})
    for _ in range(10):
        observations = batch.step([[[-1.0, 0.0], [1.0, 0.0]]])[0]
    assert batch.state["world_x"][0] == pytest.approx(4.85, abs=1e-3)
    assert batch.layout.views(observations)["touching"][0].tolist() == [0.0, 1.0]


def test_only_a_rectangle_has_a_height() -> None:
    square, wide = (posse.batch("search", 1, arena=arena) for arena in ((20.0, 20.0), (28.0, 14.0)))
    assert square.scenario == posse.get_scenario("search"), "equal sides are one"
    assert "arena_height" not in square.layout.offsets
    assert wide.layout.offsets["arena_height"] == wide.layout.offsets["arena"] + 1
    views = wide.layout.views(wide.reset())
    assert (views["arena"] == 28.0).all()
    assert (views["arena_height"] == 14.0).all()
    with pytest.raises(ValueError, match=r"x lies within ±14 m and y within ±7 m"):
        wide.reset(options={"target_pose": (0.0, 8.0, 0.0)})


@pytest.mark.parametrize("name", posse.scenario_names())
def test_views_share_memory_and_cover_the_observation(name: str) -> None:
    batch = posse.batch(name, 2, message_size=2)
    layout, observations = batch.layout, batch.reset(seed=7)
    views = layout.views(observations)
    assert all(np.shares_memory(view, observations) for view in views.values())
    marks = np.arange(observations.size, dtype=np.float32).reshape(observations.shape)
    covered = np.concatenate([view.ravel() for view in layout.views(marks).values()])
    np.testing.assert_array_equal(np.sort(covered), marks.ravel())
    for field in layout.fields:
        if not field.of_neighbour:
            at = layout.offsets[field.name]
            part = observations[..., at : at + field.size]
            np.testing.assert_array_equal(part.squeeze(-1) if field.size == 1 else part, views[field.name])
