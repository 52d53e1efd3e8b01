"""Discs never overlap each other or walls, whatever the team does.

Nor is a scripted target that trackers held until it had no room to turn; and it gets away again.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from tests.support.crowding import TOLERANCE, Complexes, Team, depth, points

import posse
from posse.declarations import TARGET_MOTIONS
from posse.scenarios import ScenarioError
from posse.scenarios.scenario import FORMATIONS

CROWDED: dict[str, Any] = {
    "num_obstacles": 8,
    "obstacle_gap": 0.5,
    "obstacle_radius": (0.3, 0.6),
    "num_trackers": 8,
    "start_distance": (1.0, 8.0),
    "horizon": 1000,
}


@st.composite
def scenarios(draw: st.DrawFn) -> posse.Scenario:
    """Draw a scenario: mostly a small arena with much in it, now and then the open plane."""

    def one_of(*values: Any) -> Any:
        return draw(st.sampled_from(values))

    radius, fastest = draw(st.floats(0.05, 0.3)), draw(st.floats(0.8, 4.0))
    walled = one_of(True, True, True, False)
    physics_step, least = one_of(0.05, 0.02, 0.1, 0.2), one_of(0.3, 0.2, 0.5)
    try:
        return posse.Scenario(
            name="drawn",
            num_trackers=one_of(8, 6, 10, 2, 1),
            tracker_speed=fastest,
            tracker_turn_rate=draw(st.floats(1.0, 5.0)),
            tracker_acceleration=one_of(math.inf, math.inf, 3.0),
            robot_radius=radius,
            target_motion=one_of(*TARGET_MOTIONS),
            target_speed=fastest * one_of(0.6, 0.3, 0.9),
            target_turn_rate=draw(st.floats(0.4, 4.0)),
            formation=one_of(*FORMATIONS),
            control_step=one_of(2, 1, 4) * physics_step,
            physics_step=physics_step,
            horizon=1000,
            arena=(draw(st.floats(8.0, 18.0)), one_of(8.0, 12.0, 18.0)) if walled else math.inf,
            num_obstacles=one_of(8, 5, 0) if walled else 0,
            obstacle_radius=(least, least + one_of(0.3, 0.0)),
            obstacle_gap=one_of(0.5, 0.0, 1.0),
            start_distance=(2 * radius + 0.3, one_of(8.0, 4.0)),
        )
    except ScenarioError:
        assume(False)
        raise


def in_the_largest_arena(speed: float, radius: float) -> posse.Scenario:
    """Where float32 is coarsest, and the moves are as long as can be checked for contact."""
    return posse.get_scenario(
        "constant",
        arena=1000.0,
        num_trackers=8,
        tracker_speed=speed,
        target_speed=0.6 * speed,
        robot_radius=radius,
        formation_distance=2 * radius + 2,
        formation_spacing=2 * radius + 2,
        start_distance=(2 * radius + 0.3, 20 * radius + 8),
    )


@settings(derandomize=True, max_examples=20, deadline=None)
@given(
    scenario=scenarios(),
    crowds=st.booleans(),
    stays=st.sampled_from([4.0, 10.0]),
    leaves=st.sampled_from([4.0, 0.0]),
    seed=st.integers(0, 1000),
)
@example(
    scenario=posse.get_scenario("obstacles", target_turn_rate=0.6, arena=16.0, **CROWDED),
    crowds=True,
    stays=4.0,
    leaves=4.0,
    seed=7,
)
@example(scenario=in_the_largest_arena(17.0, 0.4), crowds=True, stays=4.0, leaves=4.0, seed=3)
@example(scenario=in_the_largest_arena(244.0, 7.4), crowds=True, stays=4.0, leaves=4.0, seed=3)
@example(
    scenario=posse.get_scenario("field", arena=20.0, target_turn_rate=0.8, obstacle_gap=0.6),
    crowds=True,
    stays=10.0,
    leaves=4.0,
    seed=7,
)
def test_no_disc_is_ever_inside_another_or_a_wall(
    scenario: posse.Scenario, crowds: bool, stays: float, leaves: float, seed: int
) -> None:
    batch = posse.Batch(scenario, 60, seed=seed)
    try:
        batch.reset()
    except ScenarioError:
        assume(False)
    team = Team(batch, seed, crowds=crowds, stays=stays, leaves=leaves)
    low, high = batch.layout.bounds()
    for _ in range(120):
        observations, rewards = team.play()
        assert depth(batch).max() <= TOLERANCE
        assert ((observations >= low) & (observations <= high)).all()
        assert np.isfinite(rewards).all()


def tight_spots(batch: posse.Batch, rng: np.random.Generator) -> Complexes:
    """Return for each world a place beside an obstacle and near something else, or nan, (E,)."""
    s, centres = batch.scenario, points(batch, "obstacle")
    radii = batch.state["obstacle_radius"].astype(np.float64) + s.robot_radius
    spots = np.full(batch.num_worlds, np.nan + 0j)
    for _ in range(200):
        k = rng.integers(s.num_obstacles, size=(batch.num_worlds, 1))
        away = np.take_along_axis(radii, k, 1) + rng.uniform(0.001, 0.05, k.shape)
        bearing = np.exp(2j * np.pi * rng.uniform(size=k.shape))
        place = np.take_along_axis(centres, k, 1) + away * bearing
        wall = s.position_bound - s.robot_radius - np.maximum(np.abs(place.real), np.abs(place.imag))  # a square
        gaps = np.sort(np.concatenate([np.abs(centres - place) - radii, wall], axis=1), axis=1)
        tight = (gaps[:, 0] > 0.0005) & (gaps[:, 1] < 0.2)
        spots[tight] = place[tight, 0]
    return spots


@pytest.mark.parametrize(
    ("motion", "turn", "arena"), [("constant", 0.6, 16.0), ("accelerating", 1.2, 12.0), ("smart", 1.8, 12.0)]
)
def test_a_target_that_has_no_room_to_turn_does_not_get_stuck(motion: str, turn: float, arena: float) -> None:
    """Place the target as trackers can push it, in poses that it would not reach on its own."""
    batch = posse.batch(
        "obstacles", 1000, target_motion=motion, target_turn_rate=turn, arena=arena, **{**CROWDED, "num_trackers": 1}
    )
    batch.reset(seed=3)
    rng = np.random.default_rng(3)
    spots, course = tight_spots(batch, rng), np.exp(2j * np.pi * rng.uniform(size=1000))
    chosen = np.isfinite(spots) & (np.abs(points(batch, "tracker")[:, 0] - spots) > 0.5)
    assert chosen.sum() > 50
    world = batch.arrays.world
    world["x"][chosen], world["y"][chosen] = spots[chosen].real, spots[chosen].imag
    world["heading_cos"][chosen], world["heading_sin"][chosen] = (course[chosen].real, course[chosen].imag)
    world["near"][chosen] = 1
    rest = np.tile([-1.0, 0.0], (1000, 1, 1))
    standing, longest = np.zeros(1000, np.int64), 0
    for _ in range(300):
        before = points(batch, "world")
        batch.step(rest)
        assert depth(batch).max() <= TOLERANCE
        after = points(batch, "world")
        alone = np.abs(points(batch, "tracker")[:, 0] - after) > 0.5
        standing = np.where(alone & (np.abs(after - before) < 1e-3), standing + 1, 0)
        longest = max(longest, int(standing.max()))
    assert 5 < longest <= 2 * math.pi / turn / 0.1, "no longer than a turn on the spot takes"
