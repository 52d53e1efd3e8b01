"""The named scenarios: the registry, and their properties stated in docs/scenarios.md."""

from __future__ import annotations

import dataclasses
import functools
import math
import pickle

import numpy as np
import pytest
from tests.support.adapters import part

import posse
from posse.scenarios import Scenario, ScenarioError, get_scenario, scenario_names
from posse.scenarios.formation import slot_offsets

# A version rises when the behaviour of a named scenario changes, and only then.
VERSIONS = {
    "constant": 1,
    "accelerating": 1,
    "smart": 1,
    "search": 2,
    "obstacles": 2,
    "radio": 1,
    "leader-loss": 1,
    "field": 2,
    "duel": 2,
    "paper-centralized": 1,
    "paper-distributed": 1,
}


# ------------------------------------------------------------------------------------ registry


def test_the_names_and_versions_are_the_published_ones() -> None:
    assert {name: get_scenario(name).version for name in scenario_names()} == VERSIONS


def test_a_name_gives_the_scenario_of_that_name() -> None:
    for name in scenario_names():
        assert get_scenario(name).name == name


def test_a_scenario_is_taken_as_it_is() -> None:
    mine = Scenario(name="mine", num_trackers=2)
    assert get_scenario(mine) is mine
    assert get_scenario(mine, horizon=70) == Scenario(name="mine", num_trackers=2, horizon=70)


@pytest.mark.parametrize(("wrong", "near"), [("smrt", "smart"), ("leader_loss", "leader-loss"), ("feild", "field")])
def test_an_unknown_name_is_answered_with_near_ones_and_all(wrong: str, near: str) -> None:
    with pytest.raises(ScenarioError, match=f"unknown scenario {wrong!r}.*mean.*{near!r}") as info:
        get_scenario(wrong)
    for name in scenario_names():
        assert name in str(info.value)


def test_a_name_near_to_nothing_gets_no_guess() -> None:
    with pytest.raises(ScenarioError) as info:
        get_scenario("zzzzzzzz")
    assert "mean" not in str(info.value)


@pytest.mark.parametrize("name", scenario_names())
def test_an_override_changes_that_field_of_a_copy(name: str) -> None:
    before = get_scenario(name).to_dict()
    changed = get_scenario(name, num_trackers=3, horizon=77).to_dict()
    assert {k for k in before if changed[k] != before[k]} == {"num_trackers", "horizon"}
    assert (changed["num_trackers"], changed["horizon"]) == (3, 77)
    assert get_scenario(name).to_dict() == before


def test_an_unknown_or_impossible_override_is_an_error() -> None:
    with pytest.raises(ScenarioError, match=r"'sensing_rage'.*did you mean 'sensing_range'"):
        get_scenario("search", sensing_rage=2.0)
    with pytest.raises(ScenarioError, match=r"target_speed=2 must be below tracker_speed=1"):
        get_scenario("smart", target_speed=2.0)


def test_scenarios_are_values() -> None:
    for name in scenario_names():
        scenario = get_scenario(name)
        assert pickle.loads(pickle.dumps(scenario)) == scenario  # noqa: S301
        assert len({scenario, get_scenario(name)}) == 1
        with pytest.raises(dataclasses.FrozenInstanceError):
            scenario.horizon = 3  # type: ignore[misc]


# ------------------------------------------------------------------------------------ playing


@functools.cache
def started(name: str) -> posse.Batch:
    batch = posse.batch(name, num_worlds=200, seed=5)
    batch.reset()
    return batch


@pytest.mark.parametrize("name", scenario_names())
def test_it_starts_as_it_says(name: str) -> None:
    batch, s = started(name), get_scenario(name)
    state = batch.state
    distance = np.hypot(state["tracker_x"] - state["world_x"][:, None], state["tracker_y"] - state["world_y"][:, None])
    assert distance.min() >= s.start_distance[0] - 1e-4
    assert distance.max() <= s.start_distance[1] + 1e-4
    assert not state["tracker_touching"].any()
    assert (state["tracker_broken_at"] > s.horizon).all()


@pytest.mark.parametrize("name", scenario_names())
def test_it_plays_to_its_horizon(name: str) -> None:
    s = get_scenario(name)
    batch = posse.batch(name, num_worlds=6, seed=5, autoreset="disabled")
    observations = batch.reset()
    space, rng = batch.layout.bounds(), np.random.default_rng(0)
    for step in range(1, s.horizon + 1):
        # Wandering: full speed, a turn that changes now and then.
        if step % 15 == 1:
            turn = rng.uniform(-1, 1, batch.action_shape[:2]).astype(np.float32)
        actions = np.stack([np.full_like(turn, 0.8), turn], -1)
        observations, _, terminated, truncated, infos = batch.step(actions)
        assert (observations >= space[0] - 1e-4).all()
        assert (observations <= space[1] + 1e-4).all()
        assert not terminated.any()
        assert truncated.all() == (step == s.horizon)
    metrics = part(infos, "metrics/")
    assert ((metrics["score"] >= 0) & (metrics["score"] <= metrics["bound"] + 1e-6)).all()
    assert (metrics["bound"] < 1).all()
    broken = (batch.state["tracker_broken_at"] < s.horizon).sum(axis=1)
    assert (broken == s.breaks).all()


# ------------------------------------------------------------------------------------ levers


@pytest.mark.parametrize("name", scenario_names())
def test_the_bound_leaves_room_for_the_approach_and_for_a_score(name: str) -> None:
    """With a bound near 0 or at 1 a scenario could not distinguish teams."""
    batch = posse.batch(name, num_worlds=50, seed=5, autoreset="disabled")
    batch.reset()
    idle = np.zeros(batch.action_shape, np.float32)
    for _ in range(batch.scenario.horizon):
        batch.step(idle)
    assert 0.6 < batch.metrics()["bound"].mean() < 0.99


def test_only_the_first_three_differ_in_nothing_but_the_motion_of_a_free_target() -> None:
    assert get_scenario("accelerating") == get_scenario("constant", name="accelerating", target_motion="accelerating")
    for name in ("constant", "accelerating", "smart"):
        s = get_scenario(name)
        assert all(math.isinf(x) for x in (s.arena, s.sensing_range, s.radio_range))


def test_the_smart_target_is_slower_and_nimbler_than_the_trackers() -> None:
    s = get_scenario("smart")
    assert s.target_motion == "smart"
    assert s.target_speed < min(s.tracker_speeds)
    assert s.target_turn_rate > 1.5 * max(s.tracker_turn_rates)


def test_in_search_nobody_sees_the_target_at_the_start() -> None:
    s = get_scenario("search")
    assert (s.arena, s.sensing_range) == (20.0, 3.0)
    assert s.start_distance[0] > s.sensing_range
    assert not started("search").state["tracker_sees"].any()


def test_obstacles_stand_in_the_way_and_in_the_view() -> None:
    batch = started("obstacles")
    assert batch.state["obstacle_x"].shape == (200, 8)
    # Sight is unlimited: only obstacles hide the target.
    unseen = (batch.state["tracker_sees"] == 0).mean()
    assert 0.1 < unseen < 0.6


def test_in_radio_some_need_to_be_told_and_nearly_all_are_in_reach() -> None:
    batch = posse.batch("radio", num_worlds=400, seed=5)
    batch.reset()
    sees = batch.state["tracker_sees"] != 0
    assert sees.any(axis=1).mean() > 0.99
    assert (~sees).mean() > 0.2
    idle = np.zeros(batch.action_shape, np.float32)
    idle[..., 0] = -1
    for _ in range(20):
        batch.step(idle)
    assert (batch.state["tracker_fix_step"] >= 0).mean() > 0.95


def test_in_leader_loss_the_leader_alone_sees_the_target_from_its_slot() -> None:
    s = get_scenario("leader-loss")
    distances = sorted(math.hypot(x, y) for x, y in slot_offsets(s))
    assert distances[0] + s.tolerance < s.sensing_range < distances[1] - s.tolerance
    # At the start everyone does, so that nothing but the loss is tested.
    assert s.start_distance[1] < s.sensing_range
    assert started("leader-loss").state["tracker_sees"].all()


def test_in_leader_loss_the_nearest_tracker_breaks_in_mid_episode() -> None:
    batch = posse.batch("leader-loss", num_worlds=60, seed=5, autoreset="disabled")
    batch.reset()
    s, state = batch.scenario, batch.state
    idle = np.zeros(batch.action_shape, np.float32)
    for step in range(s.horizon):
        distance = np.hypot(
            state["tracker_x"] - state["world_x"][:, None], state["tracker_y"] - state["world_y"][:, None]
        )
        before = (state["tracker_broken_at"] <= step).any(axis=1, keepdims=True)
        batch.step(idle)
        now = np.asarray((state["tracker_broken_at"] <= step) & ~before)
        for e in np.flatnonzero(now.any(axis=1)):
            assert now[e].argmax() == distance[e].argmin()
            assert 0.4 <= step / s.horizon <= 0.6
    assert ((state["tracker_broken_at"] < s.horizon).sum(axis=1) == 1).all()


def test_field_has_something_of_every_other_scenario() -> None:
    s = get_scenario("field")
    assert s.target_motion == "smart"
    assert all(math.isfinite(x) for x in (s.arena, s.sensing_range, s.radio_range))
    present = (
        s.num_obstacles,
        s.range_noise,
        s.bearing_noise,
        s.radio_delay,
        s.radio_loss,
        s.breaks,
        s.sensor_outages,
        s.radio_outages,
    )
    assert min(present) > 0


def test_the_paper_is_one_set_up_under_two_names() -> None:
    centralized, distributed = get_scenario("paper-centralized"), get_scenario("paper-distributed")
    assert centralized.replace(name="paper-distributed") == distributed
    assert (centralized.num_trackers, centralized.target_motion) == (5, "constant")
