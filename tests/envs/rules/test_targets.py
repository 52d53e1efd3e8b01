"""Target motions: constant, accelerating, smart (as documented in its module), and what lies in their way."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pytest
from tests.support.reference.state import Array, Complexes, directions, points

import posse
from posse.rules.targets.smart import SMART_REPLAN

Team = Callable[[posse.Batch], npt.NDArray[Any]]
SPEED = 0.6
"""Of the target; that of the trackers is 1."""
FAR_AWAY: dict[str, Any] = {"num_trackers": 1, "start_distance": (300.0, 400.0)}


def steady(speed: float) -> Team:
    """Every tracker straight on at a speed, whatever the target does."""
    return lambda batch: np.tile([2 * speed - 1, 0.0], (*batch.action_shape[:2], 1))


def pursuing(batch: posse.Batch) -> Array:
    """Every tracker straight at the target, slower where it would touch it."""
    s, away = batch.scenario, points(batch, "world")[:, None] - points(batch, "tracker")
    error = np.angle(away / directions(batch, "tracker"))
    speed = np.where(np.abs(away) < 3 * s.robot_radius, SPEED, 1.0) * np.clip(np.cos(error), 0, 1)
    turn = np.clip(error / (s.control_step * s.tracker_turn_rates[0]), -1, 1)
    return np.stack([2 * speed - 1, turn], -1)


class Played(NamedTuple):
    """The targets at the start and after each step, (steps + 1, E), and the distance of the nearest tracker."""

    place: Complexes
    heading: Complexes
    turn_rate: Array
    nearest: Array


def play(batch: posse.Batch, steps: int, team: Team | None = None) -> Played:
    """Play so many steps; without a team, the trackers rest."""
    rows = []
    for step in range(steps + 1):
        if step:
            batch.step((team or steady(0.0))(batch))
        place, turn_rate = points(batch, "world"), batch.state["world_turn_rate"].astype(float)
        nearest = np.abs(points(batch, "tracker") - place[:, None]).min(axis=1)
        rows.append((place, directions(batch, "world"), turn_rate, nearest))
    return Played(*map(np.array, zip(*rows, strict=True)))


@pytest.mark.parametrize("limit", [0.3, 1.0, 3.0])
def test_accelerating_turns_to_and_fro_within_its_limit(limit: float) -> None:
    batch = posse.batch("accelerating", 200, target_turn_rate=limit, **FAR_AWAY)
    batch.reset(seed=2)
    turns = play(batch, 400).turn_rate
    assert np.abs(turns).max() <= limit
    assert (np.abs(turns).max(axis=0) > 0.3 * limit).all(), "every one of them turns"
    assert (turns.max(axis=0) > 0).all()
    assert (turns.min(axis=0) < 0).all()


@pytest.mark.parametrize("motion", ["constant", "accelerating", "smart"])
@pytest.mark.parametrize(("name", "arena"), [("search", 20.0), ("obstacles", (30.0, 15.0)), ("field", 24.0)])
def test_a_scripted_target_never_comes_near_a_wall_or_an_obstacle(name: str, arena: Any, motion: str) -> None:
    batch = posse.batch(name, 100, target_motion=motion, horizon=600, num_trackers=2, breaks=0, arena=arena)
    batch.reset(seed=4)
    places, courses, turns, nearest = play(batch, 595)
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
    np.testing.assert_allclose(moved[nearest[1:] > 0.5], step, atol=1e-3 * limit)
    assert np.abs(np.angle(courses[1:] / courses[:-1])).max() <= 0.1 * limit + 1e-5
    assert np.median(np.abs(places - places[0]).max(axis=0)) > 4.0, "it gets about"


def start(worlds: int, motion: str = "smart", **poses: Any) -> posse.Batch:
    batch = posse.batch("smart", worlds, target_motion=motion, autoreset="disabled")
    batch.reset(seed=3, options=poses)
    return batch


@pytest.mark.parametrize("team", [steady(0.0), pursuing])
def test_the_target_leaves_a_ring_by_the_widest_gap(team: Team) -> None:
    gaps = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    # Five trackers 60 degrees apart: the gap that is left is 120 degrees wide.
    bearings = gaps[:, None] + np.radians([60, 120, 180, 240, 300])
    trackers = np.stack([4 * np.cos(bearings), 4 * np.sin(bearings), bearings + np.pi], -1)
    theta = np.random.default_rng(0).uniform(-np.pi, np.pi, 40)
    batch = start(40, tracker_pose=trackers, target_pose=np.stack([0 * theta, 0 * theta, theta], -1))
    left = np.angle(play(batch, 35, team).place[-1] * np.exp(-1j * gaps))
    assert np.abs(left).max() < np.radians(45)
    assert np.abs(left).mean() < np.radians(20)


def test_the_target_darts_at_a_team_in_formation_and_not_before() -> None:
    theta = np.linspace(-3, 3, 24)
    slots = np.array(posse.get_scenario("smart").slot_offsets) @ [1, 1j] * np.exp(1j * theta)[:, None]
    trackers = np.stack([slots.real, slots.imag, np.broadcast_to(theta[:, None], slots.shape)], -1)
    batch = start(24, tracker_pose=trackers, target_pose=np.stack([0 * theta, 0 * theta, theta], -1))
    heading = play(batch, 60, steady(SPEED)).heading
    away = np.abs(np.angle(heading / heading[0]))
    # Straight on (to one of sixteen headings) for the 3 s in which a team settles ...
    assert away[30].max() < np.radians(25)
    # ... and then round, by more than a right angle, within the time an about-turn takes.
    assert away.max(axis=0).min() > np.radians(90)
    assert np.argmax(away > np.radians(60), axis=0).max() < 50


def test_a_tracker_that_spins_much_faster_than_the_target_turns_does_not_switch_darts_off() -> None:
    batch = posse.batch("smart", 20, target_turn_rate=0.3, tracker_turn_rate=10.0)
    batch.reset(seed=1)
    for step in range(SMART_REPLAN + 1):
        batch.arrays.world["pressed"] = 10.0 * (step > 0)
        before = points(batch, "world", "goal_cos", "goal_sin")
        batch.step(np.tile(np.array([-1, 1], np.float32), (20, 5, 1)))
    assert (np.abs(points(batch, "world", "goal_cos", "goal_sin") - before) > 0.1).mean() > 0.8


def test_the_target_escapes_trackers_that_enclose_it() -> None:
    # Two stand in its way, touching it, on both sides of where it heads; the others are far off.
    held = [[0.3005 * math.cos(b), 0.3005 * math.sin(b), b] for b in (0.7, -0.7)]
    far = [[-15.0, y, 0.0] for y in (-2.0, 0.0, 2.0)]
    batch = start(1, tracker_pose=held + far, target_pose=[0.0, 0.0, 0.0])
    assert batch.state["world_touching"][0] != 0
    assert play(batch, 40).nearest[-1, 0] > 1.0


def test_the_smart_target_evades_longer_than_the_others() -> None:
    nearest, times = {}, {}
    for motion in ("smart", "constant", "accelerating"):
        nearest[motion] = play(start(60, motion), 400, pursuing).nearest  # from the same starts
        near = nearest[motion] < 0.5
        times[motion] = np.where(near.any(axis=0), near.argmax(axis=0), len(near)) * 0.1
    for other in ("constant", "accelerating"):
        assert nearest["smart"].mean() > 1.2 * nearest[other].mean()
        assert times["smart"].mean() > 1.5 * times[other].mean()
        assert (times["smart"] > times[other]).mean() > 0.75


def test_the_target_flees_working_trackers_and_only_avoids_broken_ones() -> None:
    # One that works comes from behind. Four broken ones ahead leave one way out: straight on,
    # between them, or (with one of them in the way) past it.
    behind, wings = [-4.0, 0.0, 0.0], [[3.0, y, 0.0] for y in (-3.0, -1.5, 1.5)]
    for fourth, most in (([3.0, 3.0, 0.0], 1e-3), ([3.0, 0.0, 0.0], math.radians(70))):
        batch = start(1, tracker_pose=[behind, *wings, fourth], target_pose=[0.0, 0.0, 0.0])
        batch.arrays.tracker["broken_at"][0, 1:] = 0
        batch.arrays.world["working"] = 1
        target, heading, _, nearest = play(batch, 60, pursuing)
        assert np.abs(np.angle(heading)).max() <= most
        assert nearest.min() > 0.301, "nothing touches it"
        assert target[-1, 0].real > 3.0
