"""Target motions: constant, accelerating, and avoidance of walls and obstacles."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from tests.support.reference.state import directions, points

import posse

Complexes = npt.NDArray[np.complex128]
FAR_AWAY: dict[str, Any] = {"num_trackers": 1, "start_distance": (300.0, 400.0)}


def follow(batch: posse.Batch, steps: int) -> tuple[Complexes, Complexes, npt.NDArray[np.float64]]:
    """Return places, headings (steps + 1, E) and turn rates (steps, E) of the targets; the trackers rest."""
    places, courses, turns = [], [], []
    rest = np.tile([-1.0, 0.0], (*batch.action_shape[:2], 1))
    for _ in range(steps + 1):
        places.append(points(batch, "world"))
        courses.append(directions(batch, "world"))
        turns.append(batch.state["world_turn_rate"].astype(float))
        batch.step(rest)
    return np.array(places), np.array(courses), np.array(turns[1:])


def test_constant_goes_straight_at_its_speed() -> None:
    batch = posse.batch("constant", 20, **FAR_AWAY)
    batch.reset(seed=1)
    places, courses, turns = follow(batch, 300)
    steps = np.arange(301)[:, None]
    np.testing.assert_allclose(places, places[0] + 0.06 * steps * courses[0], rtol=1e-4, atol=2e-3)
    assert (np.abs(turns) < 1e-4).all()


@pytest.mark.parametrize("limit", [0.3, 1.0, 3.0])
def test_accelerating_turns_to_and_fro_within_its_limit(limit: float) -> None:
    batch = posse.batch("accelerating", 200, target_turn_rate=limit, **FAR_AWAY)
    batch.reset(seed=2)
    places, courses, turns = follow(batch, 400)
    assert np.abs(turns).max() <= limit
    np.testing.assert_allclose(np.abs(courses), 1.0, rtol=1e-5)
    # Continuous: each step is an arc of V dt, along the mean of the headings at its ends.
    moves, middle = np.diff(places, axis=0), courses[1:] + courses[:-1]
    swing = np.angle(courses[1:] / courses[:-1])
    chord = 0.06 * np.sinc(swing / (2 * math.pi))
    np.testing.assert_allclose(moves, chord * middle / np.abs(middle), rtol=1e-4, atol=3e-5)
    np.testing.assert_allclose(swing, turns * 0.1, rtol=1e-4, atol=3e-5)
    assert (np.abs(turns).max(axis=0) > 0.3 * limit).all(), "every one of them turns"
    assert (turns.max(axis=0) > 0).all()
    assert (turns.min(axis=0) < 0).all()


@pytest.mark.parametrize("motion", ["constant", "accelerating", "smart"])
@pytest.mark.parametrize(("name", "arena"), [("search", 20.0), ("obstacles", (30.0, 15.0)), ("field", 24.0)])
def test_a_scripted_target_never_comes_near_a_wall_or_an_obstacle(name: str, arena: Any, motion: str) -> None:
    batch = posse.batch(name, 100, target_motion=motion, horizon=600, num_trackers=2, breaks=0, arena=arena)
    batch.reset(seed=4)
    places, courses, turns = follow(batch, 595)
    s = batch.scenario
    room = np.minimum(s.half_sides[0] - np.abs(places.real), s.half_sides[1] - np.abs(places.imag))
    if s.num_obstacles:
        gaps = np.abs(places[..., None] - points(batch, "obstacle")) - batch.state["obstacle_radius"]
        room = np.minimum(room, gaps.min(axis=-1))
    assert room.min() - s.robot_radius > 0.09, "SAFE_MARGIN, rounding aside"
    limit, step = s.target_turn_rate, s.target_speed * 0.1
    assert np.abs(turns).max() <= limit * (1 + 1e-6)
    moved = np.abs(np.diff(places, axis=0))
    assert moved.max() <= step + 1e-5
    away = np.abs(places[..., None] - points(batch, "tracker")).min(axis=-1)
    np.testing.assert_allclose(moved[away[1:] > 0.5], step, atol=1e-3 * limit)
    assert np.abs(np.angle(courses[1:] / courses[:-1])).max() <= 0.1 * limit + 1e-5
    assert np.median(np.abs(places - places[0]).max(axis=0)) > 4.0, "it gets about"
