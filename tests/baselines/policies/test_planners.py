"""The planners: scores above other teams, without access to future draws or to what no tracker is told."""

from typing import Any

import numpy as np
import pytest

import posse
from posse_baselines import PolicyError, batch_for, begin, load, load_target, play, rollout
from posse_baselines.policies.belief_planner import BeliefPlanner, believed
from posse_baselines.policies.planner import Planner, PlannerSettings

QUICK = PlannerSettings(look_ahead=0.8, keep=0.4, rounds=1)
QUICK_BELIEF = PlannerSettings(look_ahead=0.8, keep=0.4, rounds=0)


@pytest.mark.parametrize(
    ("planner", "script", "scenario", "worlds", "settings"),
    [
        ("planner", "ddcs-distributed", "smart", 6, {"horizon": 300}),
        ("planner", "ddcs-distributed", "robots", 6, {"horizon": 300}),
        pytest.param("planner", "ddcs-distributed", "obstacles", 24, {"horizon": 300}, marks=pytest.mark.long),
        ("belief-planner", "ddcs-tuned", "smart", 4, {"horizon": 160, "start_distance": (1.5, 4.0)}),
    ],
)
def test_playing_ahead_is_worth_more_than_the_script(
    planner: str, script: str, scenario: str, worlds: int, settings: dict[str, Any]
) -> None:
    planned, scripted = (
        play(batch_for(team, posse.get_scenario(scenario, **settings), worlds, split="validation"), team)
        for team in (load(planner), load(script))
    )
    assert planned["safe_score"].mean() >= scripted["safe_score"].mean() + 0.05
    assert planned["contact_free"].all()


def test_a_lone_tracker_searches_where_it_has_not_been() -> None:
    alone = posse.get_scenario("search", num_trackers=1, target_speed=0.1)
    teams = load("ddcs-distributed"), BeliefPlanner(QUICK_BELIEF)
    scripted, believing = ((play(batch_for(team, alone, 60), team)["score"] > 0).mean() for team in teams)
    assert believing > scripted + 0.1


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
    alone = rollout(posse.batch("smart", 1, seed=1, first_world=1), Planner(QUICK), ["actions"], steps=23)
    np.testing.assert_array_equal(actions[1:], alone["actions"][-1])


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
    """Where copies end before their worlds, and at this distance no start can be drawn for them."""
    ends: dict[str, Any] = {"horizon": 6, "command_delay": 4, "start_distance": (0.31, 0.31)}
    batch = posse.batch("smart", 2, target_policy=load_target("evader").policy, **ends)
    poses = {"tracker_pose": [(i, 3.0, 0.0) for i in range(5)], "target_pose": (0.0, 0.0, 0.0)}
    with pytest.raises(posse.ScenarioError, match="could not place num_trackers=5 at start_distance"):
        batch.reset()
    rollout(batch, Planner(QUICK), steps=5, options=poses)


@pytest.mark.parametrize("delay", [0, 2])
def test_it_plans_beyond_the_end_of_an_episode(delay: int) -> None:  # as a robot may, which goes on
    actions = []
    for horizon in (50, 600):
        batch = posse.batch("smart", 3, horizon=horizon, settle_time=1.0, command_delay=delay)
        batch.reset()
        batch.arrays.world["step"] = 60
        actions.append(begin(Planner(), batch).actions())
    np.testing.assert_allclose(actions[0], actions[1])


def test_the_planner_reads_only_the_batch_it_watches() -> None:
    planner, other = load("planner"), posse.batch("smart", 3, num_trackers=3)
    with pytest.raises(PolicyError, match="watches none, not 3 of 'smart', whose state it reads: show it their batch"):
        planner.begin(other.layout, 3)
    begin(planner, posse.batch("constant", 2))
    with pytest.raises(PolicyError, match="watches 2 worlds of 'constant', not 3 of 'smart'"):
        planner.begin(other.layout, 3)
    with pytest.raises(PolicyError, match=r"keep=5.0.*keep must be above 0 and at most look_ahead"):
        begin(Planner(PlannerSettings(keep=5.0)), other)


def test_what_it_cannot_sense_changes_nothing() -> None:
    """Of two teams one is in sight of the target in part; where it is from the others, what it plans and the faults
    to come differ."""
    played: list[list[Any]] = [[], []]
    for hidden, actions in enumerate(played):
        policy = BeliefPlanner(QUICK_BELIEF)
        batch = posse.batch("field", 4, seed=3, start_distance=(9.0, 20.0), message_size=policy.message_size)
        observations, memory, world = batch.reset(), begin(policy, batch), batch.arrays.world
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


def test_poses_that_are_told_in_drifting_frames_are_aligned() -> None:
    drifts: dict[str, Any] = {"odometry_drift": 0.1, "heading_drift": 0.03, "horizon": 300}
    policy = load("belief-planner")
    assert play(batch_for(policy, "robots", 3, split="train", **drifts), policy)["safe_score"].mean() > 0.5


@pytest.mark.parametrize("motion", ["constant", "accelerating", "smart"])
def test_a_late_fix_is_stepped_to_the_present(motion: str) -> None:
    """What a tracker is told is 0.3 s old; of a constant target it knows the present pose, of a smart one nearly so."""
    policy = BeliefPlanner(QUICK_BELIEF)
    late: dict[str, Any] = {"sensing_range": 4.0, "radio_range": 9.0, "radio_delay": 3, "start_distance": (2.0, 6.0)}
    batch = posse.batch("smart", 8, seed=2, target_motion=motion, message_size=policy.message_size, **late)
    played = rollout(batch, policy, ["observations", "annotations", "target_pose"], steps=40)
    away = played["annotation/estimate"][..., :2] - played["target_pose"][:-1, :, None, :2]
    only_told = batch.layout.views(played["observations"][:-1])["target_age"] > 0.25
    assert only_told.sum() > 50
    wrong = np.linalg.norm(away, axis=-1)[only_told]
    assert np.median(wrong) < 0.01
    if motion == "constant":
        assert wrong.max() < 1e-3


def test_noisy_fixes_are_filtered() -> None:
    """In the longest episodes that are allowed on the open plane."""
    noise: dict[str, Any] = {"range_noise": 0.06, "bearing_noise": 0.06, "start_distance": (2.0, 4.0), "horizon": 4860}
    policy = BeliefPlanner(QUICK_BELIEF)
    batch = posse.batch("constant", 8, message_size=policy.message_size, **noise)
    played = rollout(batch, policy, ["annotations", "target_pose"], steps=30)
    away = np.abs(played["annotation/estimate"][..., :2] - played["target_pose"][:-1, :, None, :2]).max(axis=-1)
    assert np.median(away[10:]) < 0.3 * np.median(away[0])
    _, memory = policy.act(batch.reset(), begin(policy, batch))
    assert np.isfinite(memory.now.observe()).all(), "as worlds of a user's own motion must be"
    believed(batch.scenario.replace(arena=990.0, start_distance=(1.0, 1000.0)))  # the widest that is allowed


def test_a_robot_that_fell_silent_is_believed_where_it_was_heard_last() -> None:
    policy = BeliefPlanner(QUICK_BELIEF)
    batch = batch_for(policy, "field", 4, seed=3, start_distance=(2.0, 4.0))
    observations, memory = batch.reset(), begin(policy, batch)
    batch.arrays.tracker["breaks_at"][:, 0] = 20
    for _ in range(100):
        actions, memory = policy.act(observations, memory)
        observations = batch.step(actions)[0]
    robots, truly = memory.now.arrays.tracker.reshape(4, 5, 5)[:, 1:, 0], batch.arrays.tracker[:, :1]
    assert np.hypot(robots["x"] - truly["x"], robots["y"] - truly["y"]).max() < 0.2
