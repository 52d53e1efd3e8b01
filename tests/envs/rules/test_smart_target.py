"""Behaviour of the smart target as documented in its module and docs/scenarios.md."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import posse

Floats = npt.NDArray[np.float64]
Controller = Callable[[posse.Batch], npt.NDArray[np.float32]]


def resting(batch: posse.Batch) -> npt.NDArray[np.float32]:
    actions = np.zeros(batch.action_shape, np.float32)
    actions[..., 0] = -1.0
    return actions


def drive(batch: posse.Batch, wanted: npt.NDArray[np.complex128]) -> npt.NDArray[np.float32]:
    """Return the actions that take up wanted velocities vx + i vy (E, N), m/s."""
    s, state = batch.scenario, batch.state
    heading = state["tracker_heading_cos"] + 1j * state["tracker_heading_sin"]
    error = np.angle(wanted * np.conj(heading))
    turn = np.clip(error / (s.control_step * s.tracker_turn_rates[0]), -1, 1)
    speed = np.clip(np.abs(wanted) * np.cos(error), 0, s.tracker_speeds[0])
    return np.stack([2 * speed / s.tracker_speeds[0] - 1, turn], -1).astype(np.float32)


def offsets(batch: posse.Batch) -> npt.NDArray[np.complex128]:
    """Return where the target is, seen from each tracker, dx + i dy (E, N), m."""
    state = batch.state
    dx = state["world_x"][:, None] - state["tracker_x"]
    return np.asarray(dx + 1j * (state["world_y"][:, None] - state["tracker_y"]))


def pursuing(batch: posse.Batch) -> npt.NDArray[np.float32]:
    """Every tracker straight at the target, slower where it would touch it."""
    to_target = offsets(batch)
    distance = np.abs(to_target)
    speed = np.where(distance < 3 * batch.scenario.robot_radius, 0.6, 1.0)
    return drive(batch, batch.scenario.tracker_speeds[0] * speed * to_target / distance)


def flying_blind(batch: posse.Batch) -> npt.NDArray[np.float32]:
    """Every tracker straight on at the target's speed, whatever it does."""
    actions = np.zeros(batch.action_shape, np.float32)
    actions[..., 0] = 2 * batch.scenario.target_speed / batch.scenario.tracker_speeds[0] - 1
    return actions


class Play:
    """Recording of a team's play: arrays over T + 1 frames."""

    def __init__(self, batch: posse.Batch, team: Controller, steps: int) -> None:
        target, nearest, heading, touched, score = [], [], [], [], []
        for step in range(steps + 1):
            state = batch.state
            target.append(state["world_x"] + 1j * state["world_y"].astype(np.float64))
            heading.append(state["world_heading_cos"] + 1j * state["world_heading_sin"])
            nearest.append(np.abs(offsets(batch)).min(axis=1))
            touched.append(state["world_touching"] != 0)
            score.append(state["world_score"].copy())
            if step < steps:
                batch.step(team(batch))
        self.target = np.array(target)  # x + iy (T + 1, E), m
        self.heading = np.array(heading)  # cos θ + i sin θ (T + 1, E)
        self.nearest = np.array(nearest)  # distance of the nearest tracker (T + 1, E), m
        self.touched = np.array(touched)  # whether any tracker touches the target (T + 1, E)
        self.score = np.array(score)[1:]  # (T, E)

    @property
    def turns(self) -> Floats:
        """Turn of the target in every step, (T, E), rad."""
        return np.asarray(np.angle(self.heading[1:] * np.conj(self.heading[:-1])))


def start(
    worlds: int,
    scenario: str = "smart",
    *,
    tracker_pose: object = None,
    target_pose: object = None,
    seed: int = 3,
    **overrides: Any,
) -> posse.Batch:
    batch = posse.batch(scenario, num_worlds=worlds, seed=seed, autoreset="disabled", **overrides)
    poses = {"tracker_pose": tracker_pose, "target_pose": target_pose}
    batch.reset(options={name: pose for name, pose in poses.items() if pose is not None})
    return batch


@functools.cache
def pursued(motion: str) -> Play:
    """200 worlds of a pursuing team; the same starts, speeds and limits for every motion."""
    return Play(start(200, target_motion=motion), pursuing, 600)


def in_slots(worlds: int) -> tuple[Floats, Floats]:
    """Poses of a team that stands in its slots, one heading a world."""
    theta = np.linspace(-3, 3, worlds)
    slots = np.array([x + 1j * y for x, y in posse.get_scenario("smart").slot_offsets])
    places = slots * np.exp(1j * theta)[:, None]
    trackers = np.stack([places.real, places.imag, np.broadcast_to(theta[:, None], places.shape)], -1)
    return trackers, np.stack([0 * theta, 0 * theta, theta], -1)


@pytest.mark.parametrize("team", [resting, pursuing])
def test_it_leaves_a_ring_by_the_widest_gap(team: Controller) -> None:
    gaps = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    # Five trackers 60 degrees apart: the gap that is left is 120 degrees wide.
    bearings = gaps[:, None] + np.radians([60, 120, 180, 240, 300])
    trackers = np.stack([4 * np.cos(bearings), 4 * np.sin(bearings), bearings + np.pi], -1)
    headings = np.random.default_rng(0).uniform(-np.pi, np.pi, 40)
    batch = start(40, tracker_pose=trackers, target_pose=np.stack([0 * headings, 0 * headings, headings], -1))
    play = Play(batch, team, 35)
    left = np.angle(play.target[-1] * np.exp(-1j * gaps))
    assert np.abs(left).max() < np.radians(45)
    assert np.abs(left).mean() < np.radians(20)


def test_it_turns_on_a_team_that_keeps_station_and_not_before() -> None:
    trackers, target = in_slots(24)
    batch = start(24, tracker_pose=trackers, target_pose=target)
    play = Play(batch, flying_blind, 60)
    away = np.abs(np.angle(play.heading * np.conj(play.heading[0])))
    # Straight on (to one of sixteen headings) for the 3 s in which a team settles ...
    assert away[30].max() < np.radians(25)
    # ... and then round, by more than a right angle, within the time an about-turn takes.
    assert away.max(axis=0).min() > np.radians(90)
    assert np.argmax(away > np.radians(60), axis=0).max() < 50


def test_it_turns_away_from_a_tracker_that_comes_too_near() -> None:
    # No formation: a single tracker comes from behind at full speed.
    trackers = [[-1.0, 0.0, 0.0], *([-19.0 + k, 0.0, 0.0] for k in range(4))]
    batch = start(1, tracker_pose=trackers, target_pose=[0.0, 0.0, 0.0])
    play = Play(batch, pursuing, 25)
    assert np.abs(np.angle(play.heading)).max() > np.radians(60)


def test_it_gets_away_from_trackers_that_hold_it_fast() -> None:
    # Two stand in its way, touching it, on both sides of where it heads; the others are far off.
    touching = 2 * posse.get_scenario("smart").robot_radius + 5e-4
    held = [[touching * math.cos(b), touching * math.sin(b), b] for b in (0.7, -0.7)]
    far = [[-15.0, y, 0.0] for y in (-2.0, 0.0, 2.0)]
    batch = start(1, tracker_pose=held + far, target_pose=[0.0, 0.0, 0.0])
    assert batch.state["world_touching"][0] != 0
    play = Play(batch, resting, 40)
    assert play.nearest[-1, 0] > 1.0


@pytest.mark.parametrize("motion", ["constant", "accelerating"])
def test_it_holds_off_a_pursuing_team_longer(motion: str) -> None:
    smart, other = pursued("smart"), pursued(motion)
    np.testing.assert_array_equal(smart.target[0], other.target[0])  # paired
    assert smart.nearest.mean() > 1.2 * other.nearest.mean()

    def time_to_close_in(play: Play) -> Floats:
        near = play.nearest < 0.5
        return np.where(near.any(axis=0), near.argmax(axis=0), len(near)) * 0.1

    assert time_to_close_in(smart).mean() > 1.5 * time_to_close_in(other).mean()
    assert (time_to_close_in(smart) > time_to_close_in(other)).mean() > 0.75


def test_it_obeys_its_turn_limit_and_keeps_its_speed() -> None:
    play, s = pursued("smart"), posse.get_scenario("smart")
    most = s.target_turn_rate * s.control_step
    assert np.abs(play.turns).max() <= most * (1 + 1e-4)
    assert np.abs(play.turns).max() > 0.9 * most
    steps = np.abs(np.diff(play.target, axis=0))
    assert steps.max() <= s.target_speed * s.control_step * (1 + 1e-3)
    free = ~(play.touched[1:] | play.touched[:-1])
    # The chord of an arc is shorter than the arc, by h²/6 with h half the turn.
    assert steps[free].min() >= s.target_speed * s.control_step * (1 - most**2 / 24 - 1e-3)


def test_it_flees_from_trackers_that_work_and_only_steers_clear_of_broken_ones() -> None:
    # One that works comes from behind. Four broken ones ahead leave one way out: straight on,
    # between them, or (with one of them in the way) past it.
    behind, wings = [-4.0, 0.0, 0.0], [[3.0, y, 0.0] for y in (-3.0, -1.5, 1.5)]
    for fourth, most in (([3.0, 3.0, 0.0], 1e-3), ([3.0, 0.0, 0.0], math.radians(70))):
        batch = start(1, tracker_pose=[behind, *wings, fourth], target_pose=[0.0, 0.0, 0.0])
        batch.arrays.tracker["broken_at"][0, 1:] = 0
        batch.arrays.world["working"] = 1
        play = Play(batch, pursuing, 60)
        assert np.abs(np.angle(play.heading)).max() <= most
        assert not play.touched.any()
        assert play.target[-1, 0].real > 3.0
