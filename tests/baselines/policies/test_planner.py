"""The planner: scores above other teams, without access to future random draws."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import posse
from posse_baselines import PolicyError, begin, load, play, rollout
from posse_baselines.policies.planner import Planner, PlannerSettings

QUICK = PlannerSettings(look_ahead=0.8, keep=0.4, rounds=1)
"""Looks ahead for a shorter time than it should."""


def actions_of(planner: Planner, batch: posse.Batch, steps: int) -> NDArray[np.float32]:
    """Return the actions (steps, E, N, 2 + m) of so many steps."""
    return rollout(batch, planner, ["actions"], steps=steps)["actions"]


@pytest.mark.long
def test_it_reaches_nine_tenths_of_the_bound_on_constant() -> None:
    metrics = play(posse.batch("constant", 10, split="train"), Planner(QUICK))
    assert metrics["safe_score"].mean() >= 0.9 * metrics["bound"].mean()


@pytest.mark.parametrize("name", ["smart", "robots", pytest.param("obstacles", marks=pytest.mark.long)])
def test_playing_ahead_is_worth_more_than_the_scripted_team(name: str) -> None:
    planned = play(posse.batch(name, 6, split="validation", horizon=300), load("planner"))
    team = load("ddcs-distributed")
    scripted = play(posse.batch(name, 6, split="validation", horizon=300, message_size=team.message_size), team)
    assert planned["safe_score"].mean() >= scripted["safe_score"].mean() + 0.05
    assert planned["contact_free"].all()


def test_worlds_whose_episodes_begin_at_different_steps_are_played_as_alone() -> None:
    planner, batch = Planner(QUICK), posse.batch("smart", 2, seed=1)
    memory, observations = begin(planner, batch), batch.reset()
    for step in range(23):
        if step == 7:
            mask = np.array([True, False])
            observations = batch.reset(options={"reset_mask": mask})
            memory = planner.restart(memory, mask)
        actions, memory = planner.act(observations, memory)
        observations = batch.step(actions)[0]
    other = actions_of(Planner(QUICK), posse.batch("smart", 1, seed=1, first_world=1), 23)
    np.testing.assert_array_equal(actions[1:], other[-1])


def test_it_does_not_know_the_faults_to_come() -> None:
    """Worlds that differ only in the future break of a tracker are played equally."""
    planned = []
    for when in (10, 500):
        batch = posse.batch("leader-loss", 30, seed=3, start_distance=(1.5, 3.0))
        planner, observations = Planner(), batch.reset()
        batch.arrays.world["break_step"][:] = when
        planned.append(planner.act(observations, begin(planner, batch))[0])
    np.testing.assert_array_equal(planned[0], planned[1])


def test_it_plays_beside_a_target_that_is_an_agent() -> None:
    batch = posse.batch("smart", 2, target_motion="agent")
    planner = Planner(QUICK)
    observations = batch.reset()[:, :5]
    memory = begin(planner, batch)
    for _ in range(5):
        actions, memory = planner.act(observations, memory)
        assert actions.shape == (2, 5, 2)
        target = np.full((2, 1, 2), 0.5, np.float32)
        observations = batch.step(np.concatenate([actions, target], axis=1))[0][:, :5]


def test_the_planner_reads_only_the_batch_it_watches() -> None:
    planner, other = load("planner"), posse.batch("smart", 3, num_trackers=3)
    with pytest.raises(PolicyError, match="watches none, not 3 of 'smart', whose state it reads: show it their batch"):
        planner.begin(other.layout, 3)
    begin(planner, posse.batch("constant", 2))
    with pytest.raises(PolicyError, match="watches 2 worlds of 'constant', not 3 of 'smart'"):
        planner.begin(other.layout, 3)
