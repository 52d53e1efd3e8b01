"""Behaviour of the smart target as documented in its module and docs/scenarios.md."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from tests.support.reference.state import Array, Complexes, directions, points

import posse

Team = Callable[[posse.Batch], npt.NDArray[Any]]
SPEED = 0.6
"""Of the target; that of the trackers is 1."""


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


def play(batch: posse.Batch, team: Team, steps: int) -> tuple[Complexes, Complexes, Array]:
    """Return places and headings of the target and distances of the nearest tracker, (steps + 1, E)."""
    target, heading, nearest = [], [], []
    for step in range(steps + 1):
        if step:
            batch.step(team(batch))
        target.append(points(batch, "world"))
        heading.append(directions(batch, "world"))
        nearest.append(np.abs(points(batch, "tracker") - target[-1][:, None]).min(axis=1))
    return np.array(target), np.array(heading), np.array(nearest)


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
    target, _, _ = play(batch, team, 35)
    left = np.angle(target[-1] * np.exp(-1j * gaps))
    assert np.abs(left).max() < np.radians(45)
    assert np.abs(left).mean() < np.radians(20)


def test_the_target_darts_at_a_team_in_formation_and_not_before() -> None:
    theta = np.linspace(-3, 3, 24)
    slots = np.array(posse.get_scenario("smart").slot_offsets) @ [1, 1j] * np.exp(1j * theta)[:, None]
    trackers = np.stack([slots.real, slots.imag, np.broadcast_to(theta[:, None], slots.shape)], -1)
    batch = start(24, tracker_pose=trackers, target_pose=np.stack([0 * theta, 0 * theta, theta], -1))
    _, heading, _ = play(batch, steady(SPEED), 60)
    away = np.abs(np.angle(heading / heading[0]))
    # Straight on (to one of sixteen headings) for the 3 s in which a team settles ...
    assert away[30].max() < np.radians(25)
    # ... and then round, by more than a right angle, within the time an about-turn takes.
    assert away.max(axis=0).min() > np.radians(90)
    assert np.argmax(away > np.radians(60), axis=0).max() < 50


def test_the_target_escapes_trackers_that_enclose_it() -> None:
    # Two stand in its way, touching it, on both sides of where it heads; the others are far off.
    held = [[0.3005 * math.cos(b), 0.3005 * math.sin(b), b] for b in (0.7, -0.7)]
    far = [[-15.0, y, 0.0] for y in (-2.0, 0.0, 2.0)]
    batch = start(1, tracker_pose=held + far, target_pose=[0.0, 0.0, 0.0])
    assert batch.state["world_touching"][0] != 0
    _, _, nearest = play(batch, steady(0.0), 40)
    assert nearest[-1, 0] > 1.0


def test_the_smart_target_evades_longer_than_the_others() -> None:
    nearest, times = {}, {}
    for motion in ("smart", "constant", "accelerating"):
        _, _, nearest[motion] = play(start(60, motion), pursuing, 400)  # from the same starts
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
        target, heading, nearest = play(batch, pursuing, 60)
        assert np.abs(np.angle(heading)).max() <= most
        assert nearest.min() > 0.301, "nothing touches it"
        assert target[-1, 0].real > 3.0
