"""The belief planner: plans from what its trackers observe and are told, and from nothing else."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import posse
from posse_baselines import begin, load, play
from posse_baselines.policies.belief_planner import BeliefPlanner, BeliefSettings
from posse_baselines.policies.planner import PlannerSettings

QUICK = BeliefSettings(plan=PlannerSettings(look_ahead=0.8, keep=0.4, rounds=0))
"""Looks ahead for a shorter time than it should."""


def batch_of(scenario: str, worlds: int, **settings: Any) -> posse.Batch:
    return posse.batch(scenario, worlds, message_size=load("belief-planner").message_size, **settings)


def test_playing_ahead_in_beliefs_is_worth_more_than_the_script() -> None:
    planned, scripted = (
        play(batch_of("smart", 4, split="validation", horizon=160, start_distance=(1.5, 4.0)), load(name))
        for name in ("belief-planner", "ddcs-tuned")
    )
    assert planned["safe_score"].mean() >= scripted["safe_score"].mean() + 0.05
    assert planned["contact_free"].all()


def test_what_it_cannot_sense_changes_nothing() -> None:
    """Of two teams one is in sight of the target in part; where it is from the others, what it plans and the faults
    to come differ."""
    played: list[list[Any]] = [[], []]
    for hidden, actions in enumerate(played):
        batch = batch_of("field", 4, seed=3, start_distance=(9.0, 20.0))
        policy, observations = BeliefPlanner(QUICK), batch.reset()
        memory, world = begin(policy, batch), batch.arrays.world
        if hidden:
            world["x"] += 0.5 * np.sign(world["x"])
            world["heading_cos"], world["heading_sin"] = world["heading_sin"], world["heading_cos"].copy()
            world["pressed"] = 2.0
            batch.arrays.tracker["breaks_at"] = 50
        for _ in range(15):
            assert not batch.layout.views(observations)["target_known"].any()
            acted, memory = policy.act(observations, memory)
            actions.append(acted)
            observations = batch.step(acted)[0]
    np.testing.assert_array_equal(played[0], played[1])


@pytest.mark.parametrize("motion", ["constant", "smart"])
def test_a_late_fix_is_stepped_to_the_present(motion: str) -> None:
    """What a tracker is told is 0.3 s old; of a constant target it knows the present pose, of a smart one nearly so."""
    late = {"sensing_range": 4.0, "radio_range": 9.0, "radio_delay": 3, "start_distance": (2.0, 6.0)}
    batch = batch_of("smart", 8, seed=2, target_motion=motion, **late)
    policy, observations = BeliefPlanner(QUICK), batch.reset()
    memory, errors, ages = begin(policy, batch), [], []
    for _ in range(40):
        actions, memory = policy.act(observations, memory)
        views, world = batch.layout.views(observations), batch.worlds
        away = policy.annotations(memory)["estimate"][..., :2] - np.stack([world["x"], world["y"]], axis=-1)[:, None]
        errors.append(np.linalg.norm(away, axis=-1))
        ages.append(views["target_age"])
        observations = batch.step(actions)[0]
    only_told = np.array(ages) > 0.25
    assert only_told.sum() > 50
    wrong = np.array(errors)[only_told]
    assert np.median(wrong) < 0.01
    if motion == "constant":
        assert wrong.max() < 1e-3


def test_settings_out_of_range_are_refused() -> None:
    with pytest.raises(ValueError, match=r"fix_trust=0.0 must lie in \[0.01, 1\]"):
        BeliefSettings(fix_trust=0.0)
