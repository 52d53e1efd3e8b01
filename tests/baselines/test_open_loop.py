"""Targets that read nothing: their motion, and what they cost the tuned script in the duel."""

from __future__ import annotations

import numpy as np
import pytest

import posse
from posse_baselines import load, load_target, play
from posse_baselines.playing import rollout
from posse_baselines.policies.open_loop import OPEN_LOOP


def safe_score(target: str) -> float:
    team = load("ddcs-tuned")
    moved = load_target(target)
    scenario = moved.fit(posse.get_scenario("duel"))
    batch = posse.batch(scenario, 40, seed=3, split="test", message_size=team.message_size, target_policy=moved.policy)
    return float(play(batch, team)["safe_score"].mean())


@pytest.mark.long
def test_none_costs_the_tuned_script_more_than_a_tenth() -> None:
    own = safe_score("smart")
    for name in ("constant", *OPEN_LOOP):
        assert safe_score(name) > own - 0.1, name


@pytest.mark.parametrize(("name", "turns"), [("left-circle", 1.0), ("right-circle", -1.0), ("wide-circle", 0.5)])
def test_a_circle_is_one(name: str, turns: float) -> None:
    batch = posse.batch("duel", 3, target_policy=load_target(name).policy)
    poses = rollout(batch, load("idle"), ["target_pose"], steps=40)["target_pose"]
    scenario = batch.scenario
    turned = np.unwrap(poses[..., 2], axis=0)
    rate = turns * scenario.target_turn_rate
    np.testing.assert_allclose(np.diff(turned, axis=0), rate * scenario.control_step, rtol=1e-3, atol=1e-3)
    speed = np.linalg.norm(np.diff(poses[..., :2], axis=0), axis=-1) / scenario.control_step
    assert (speed <= scenario.target_speed * 1.001).all()
    assert (speed >= scenario.target_speed * 0.98).all()


def test_the_clock_starts_anew_with_a_world() -> None:
    policy = OPEN_LOOP["stop-and-go"]
    clock = policy.begin(posse.batch("duel", 2).layout, 2)
    row = np.zeros((2, 1, 1), np.float32)
    for _ in range(16):
        actions, clock = policy.act(row, clock)
    assert actions[:, 0, 0].tolist() == [1.0, 1.0]
    clock = policy.restart(clock, np.array([True, False]))
    actions, clock = policy.act(row, clock)
    assert actions[:, 0, 0].tolist() == [-1.0, 1.0]
