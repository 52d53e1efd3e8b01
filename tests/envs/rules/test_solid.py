"""Exact arcs; discs never overlap each other or walls, whatever the team does.

Nor is a scripted target that trackers held until it had no room to turn; and it gets away again.
"""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from tests.envs.test_random_worlds import SETTINGS, started
from tests.support.reference.state import Complexes, directions, on_arc, one_world, points, positions, snapshot

import posse
from posse.rules import arc
from posse_baselines import load, rollout

TOLERANCE = 1e-4  # m
CROWDED: dict[str, Any] = {
    "num_obstacles": 8,
    "obstacle_gap": 0.5,
    "obstacle_radius": (0.3, 0.6),
    "num_trackers": 8,
    "start_distance": (1.0, 8.0),
}


def crowd(batch: posse.Batch, rng: np.random.Generator, crowds: bool) -> Iterator[tuple[Any, Any]]:
    """Yield observations and rewards of a team at full speed; a target that is an agent does as it likes.

    For 4 s, trackers go to the target, or side by side in front of it (how far in front, and how wide, is drawn for
    each world); for the next 4 s, away from it.
    """
    s, n = batch.scenario, batch.scenario.num_trackers
    ahead = rng.uniform(0.0, 0.8, (batch.num_worlds, 1))
    aside = rng.uniform(0.0, 1.2, (batch.num_worlds, 1)) * np.linspace(-1, 1, n)
    for step in range(120):
        target, trackers = points(batch, "world")[:, None], points(batch, "tracker")
        goal = target + crowds * directions(batch, "world")[:, None] * (ahead + 1j * aside)
        if step * s.control_step % 8.0 >= 4.0:
            goal = 2 * trackers - target
        bearing = np.angle((goal - trackers) / directions(batch, "tracker"))
        actions = rng.uniform(-1, 1, batch.action_shape)
        actions[:, :n, 0] = 1.0
        actions[:, :n, 1] = np.clip(bearing / (s.control_step * np.array(s.tracker_turn_rates)), -1, 1)
        yield batch.step(actions)[:2]


def depth(batch: posse.Batch) -> float:
    """Return the deepest overlap of a disc with another or a wall, m."""
    s = batch.scenario
    robots = np.concatenate([points(batch, "tracker"), points(batch, "world")[:, None]], axis=1)
    apart = np.abs(robots[:, :, None] - robots[:, None, :])
    apart[:, np.arange(s.num_trackers + 1), np.arange(s.num_trackers + 1)] = np.inf
    overlaps = [2 * s.robot_radius - apart.min()]
    for half, at in zip(s.half_sides, (robots.real, robots.imag), strict=True):
        overlaps.append(np.abs(at).max() + s.robot_radius - half)
    if s.num_obstacles:
        widths = batch.state["obstacle_radius"].astype(np.float64)[:, None, :] + s.robot_radius
        overlaps.append((widths - np.abs(robots[:, :, None] - points(batch, "obstacle")[:, None, :])).max())
    return float(max(overlaps))


def in_the_largest_arena(speed: float, radius: float) -> dict[str, Any]:
    """Where float32 is coarsest, and the moves are as long as can be checked for contact."""
    return {
        "arena": 1000.0,
        "num_trackers": 8,
        "tracker_speed": speed,
        "target_speed": 0.6 * speed,
        "robot_radius": radius,
        "formation_distance": 2 * radius + 2,
        "formation_spacing": 2 * radius + 2,
        "start_distance": (2 * radius + 0.3, 20 * radius + 8),
    }


@settings(max_examples=20)
@given(name=st.sampled_from(posse.scenario_names()), changes=SETTINGS, crowds=st.booleans(), seed=st.integers(0, 1000))
@example(name="obstacles", changes={"target_turn_rate": 0.6, "arena": 16.0, **CROWDED}, crowds=True, seed=7)
@example(name="constant", changes=in_the_largest_arena(17.0, 0.4), crowds=True, seed=3)
@example(name="constant", changes=in_the_largest_arena(244.0, 7.4), crowds=True, seed=3)
@example(name="field", changes={"arena": 20.0, "target_turn_rate": 0.8, "obstacle_gap": 0.6}, crowds=True, seed=7)
def test_no_disc_is_ever_inside_another_or_a_wall(name: str, changes: dict[str, Any], crowds: bool, seed: int) -> None:
    batch, _ = started(name, 60, seed=seed, **{**changes, "horizon": 1000})
    low, high = batch.layout.bounds()
    for observations, rewards in crowd(batch, np.random.default_rng(seed), crowds):
        assert depth(batch) <= TOLERANCE
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
    made: dict[str, Any] = {**CROWDED, "num_trackers": 1, "target_motion": motion, "target_turn_rate": turn}
    batch = posse.batch("obstacles", 1000, arena=arena, **made)
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
        assert depth(batch) <= TOLERANCE
        after = points(batch, "world")
        alone = np.abs(points(batch, "tracker")[:, 0] - after) > 0.5
        standing = np.where(alone & (np.abs(after - before) < 1e-3), standing + 1, 0)
        longest = max(longest, int(standing.max()))
    assert 5 < longest <= 2 * math.pi / turn / 0.1, "no longer than a turn on the spot takes"


F = np.float32


@settings(max_examples=300)
@given(
    theta=st.floats(-math.pi, math.pi),
    speed=st.floats(0, 100),
    turn=st.one_of(st.floats(-1, 1), st.floats(-1e-6, 1e-6)),
    time=st.sampled_from([0.01, 0.05, 0.1, 1.0]),
)
def test_a_step_lies_on_the_circle(theta: float, speed: float, turn: float, time: float) -> None:
    rate = turn / time  # the turn in one step is at most 1 rad
    dx, dy, c, s = arc(F(math.cos(theta)), F(math.sin(theta)), F(speed), F(rate), F(time))
    start = complex(F(math.cos(theta)), F(math.sin(theta)))
    place, heading = on_arc(0j, start, float(F(speed)), float(F(rate)), float(F(time)))
    assert abs(complex(dx, dy) - place) <= 2e-6 * speed * time + 1e-12
    assert abs(complex(c, s) - heading / abs(heading)) < 2e-6


def test_a_heading_stays_a_unit_vector_for_many_steps() -> None:
    batch = posse.batch(num_worlds=64, num_trackers=3, horizon=10_000, arena=400.0, start_distance=(50.0, 90.0))
    rollout(batch, load("random"), seed=1)
    state = batch.state
    for name in ("tracker_heading", "world_heading", "world_frame"):
        length = np.hypot(state[f"{name}_cos"].astype(float), state[f"{name}_sin"])
        np.testing.assert_allclose(length, 1.0, rtol=0, atol=3e-7)


@settings(max_examples=60)
@given(
    speed=st.floats(1.0, 100.0),
    away=st.floats(0.5, 9.0),
    bearing=st.floats(-math.pi, math.pi),
    miss=st.floats(-0.6, 0.6),
)
def test_a_fast_robot_stops_at_what_is_in_its_way(speed: float, away: float, bearing: float, miss: float) -> None:
    """Against the intersection of a straight line with a circle."""
    batch = posse.batch(num_trackers=2, tracker_speed=speed, physics_step=0.1, target_speed=0.5, horizon=30)
    direction = np.exp(1j * bearing)
    start = -direction * (away + 0.3) + 1j * direction * miss
    poses = [[start.real, start.imag, bearing], [0.0, 0.0, 0.0]]
    batch.reset(options={"tracker_pose": poses, "target_pose": [15.0, 15.0, 0.0]})
    batch.step(np.array([[[1.0, 0.0], [-1.0, 0.0]]]))
    place = positions(one_world(snapshot(batch), 0))[0]
    along = ((place - start) * np.conj(direction)).real
    reach, step = 0.3 + 0.0005, speed * 0.1
    free = step
    if abs(miss) < reach:
        free = min(step, away + 0.3 - math.sqrt(reach**2 - miss**2))
    assert along == pytest.approx(free, abs=2e-3 if abs(abs(miss) - reach) < 1e-3 else 2e-4)
    assert abs(place) > 0.3
