"""Contact: nothing passes into or through anything, and every contact is counted once."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.support.reference.motion import free_gaps
from tests.support.reference.score import Episode
from tests.support.reference.state import one_world, positions, snapshot

import posse


def at(batch: posse.Batch, target: list[float], *trackers: list[float]) -> None:
    batch.reset(options={"tracker_pose": list(trackers), "target_pose": target})


def act(batch: posse.Batch, *actions: list[float]) -> dict[str, Any]:
    return batch.step(np.array([actions], np.float32))[-1]


def least_gap(batch: posse.Batch) -> float:
    state = snapshot(batch)
    worlds = [one_world(state, e) for e in range(batch.num_worlds)]
    return min(float(free_gaps(batch.scenario, world).min()) for world in worlds)


@settings(derandomize=True, max_examples=60, deadline=None)
@given(
    speed=st.floats(1.0, 100.0),
    away=st.floats(0.5, 9.0),
    bearing=st.floats(-math.pi, math.pi),
    miss=st.floats(-0.6, 0.6),
    obstacle=st.booleans(),
)
def test_a_fast_robot_stops_where_it_meets_what_is_in_its_way(
    speed: float, away: float, bearing: float, miss: float, obstacle: bool
) -> None:
    """Against the intersection of a straight line with a circle."""
    batch = posse.batch(num_trackers=2, tracker_speed=speed, physics_step=0.1, target_speed=0.5, horizon=30)
    direction = np.exp(1j * bearing)
    start = -direction * (away + 0.3) + 1j * direction * miss
    at(batch, [15.0, 15.0, 0.0], [start.real, start.imag, bearing], [0.0, 0.0, 0.0])
    act(batch, [1.0, 0.0], [-1.0, 0.0])
    place = positions(one_world(snapshot(batch), 0))[0]
    along = ((place - start) * np.conj(direction)).real
    reach, step = 0.3 + 0.0005, speed * 0.1
    free = step
    if abs(miss) < reach:
        free = min(step, away + 0.3 - math.sqrt(reach**2 - miss**2))
    assert along == pytest.approx(free, abs=2e-3 if abs(abs(miss) - reach) < 1e-3 else 2e-4)
    assert abs(place) > 0.3


@pytest.mark.parametrize("speed", [1.0, 40.0])
def test_walls_hold(speed: float) -> None:
    batch = posse.batch(num_trackers=4, arena=10.0, tracker_speed=speed, start_distance=(1.0, 5.0))
    at(
        batch,
        [0.0, 0.0, 1.0],
        [4.0, 1.0, 0.0],
        [-4.0, 1.0, math.pi],
        [1.0, 4.0, math.pi / 2],
        [1.0, -4.0, -math.pi / 2],
    )
    for _ in range(30):
        infos = act(batch, *[[1.0, 0.0]] * 4)
    state = one_world(snapshot(batch), 0)
    reached = np.max(np.abs([state["tracker_x"], state["tracker_y"]]), axis=0)
    np.testing.assert_allclose(reached, 10 / 2 - 0.15, atol=0.001)
    assert (reached < 4.85).all()
    assert state["world_contacts_obstacle"] == 4, "once each, though all kept pushing"
    assert (infos["reward/contact"] == 0).all()


def test_contacts_are_counted_at_their_onset_and_by_kind() -> None:
    batch = posse.batch(num_trackers=2, target_motion="agent", arena=20.0)
    at(batch, [0.9, 0.0, 0.0], [0.0, 0.0, 0.0], [0.45, 0.0, 0.0])
    stay = [-1.0, 0.0]
    counts = []
    for actions in (
        [[1.0, 0.0], stay, stay],
        [[1.0, 0.0], stay, stay],
        [[1.0, 0.0], stay, stay],
        [stay, [1.0, 0.0], stay],
        [stay, [1.0, 0.0], stay],
        [stay, [1.0, 0.0], stay],
        [[1.0, 0.0], stay, stay],
        [[1.0, 0.0], stay, stay],
        [[1.0, 0.0], stay, stay],
    ):
        infos = act(batch, *actions)
        w = batch.worlds[0]
        counts.append((int(w.contacts_tracker), int(w.contacts_target), int(w.contacts_obstacle)))
        assert infos["reward/contact"].shape == (1, 3)
    assert counts == [(0, 0, 0), (1, 0, 0), (1, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 0), (1, 1, 0), (2, 1, 0), (2, 1, 0)]


def test_a_robot_that_is_far_from_all_is_swept_as_soon_as_it_matters() -> None:
    """The engine sweeps only robots that are near something, which must be detected in time."""
    batch = posse.batch(
        "obstacles",
        32,
        num_trackers=16,
        tracker_speed=3.0,
        start_distance=(1.0, 10.0),
        tracker_acceleration=math.inf,
        tracker_turn_acceleration=math.inf,
    )
    batch.reset(seed=4)
    episodes = [Episode(batch.scenario) for _ in range(2)]
    rng = np.random.default_rng(4)
    actions: npt.NDArray[np.float64] = np.zeros(batch.action_shape)
    for k in range(60):
        if k % 10 == 0:
            actions = rng.uniform(-0.2, 0.2, batch.action_shape) + np.array([0.8, 0.0])
        infos = batch.step(actions)[-1]
        assert least_gap(batch) > 0
        state = snapshot(batch)
        for e, episode in enumerate(episodes):
            if k == 0:
                episode.follow(one_world(state, e))  # what touched at the start is not of interest
                continue
            episode.follow(one_world(state, e))
            np.testing.assert_array_equal(infos["reward/contact"][e], episode.onsets)


def test_the_least_gap_is_to_anything_however_slow_the_robots() -> None:
    batch = posse.batch("obstacles", 16)
    batch.reset(seed=6)
    state = snapshot(batch)
    for e in range(16):
        least = float(free_gaps(batch.scenario, one_world(state, e)).min())
        assert batch.metrics()["least_gap"][e] == pytest.approx(least, rel=1e-4, abs=1e-4)
