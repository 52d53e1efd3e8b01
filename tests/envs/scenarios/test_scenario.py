"""Scenarios: values, overrides, errors; the named ones, what the manual states of them, and slots."""

import dataclasses
import math
import pickle
from typing import Any

import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from tests.support.reference.score import slots
from tests.support.reference.state import directions, points

import posse
from posse import Scenario, ScenarioError
from posse.scenarios.scenario import FORMATIONS
from posse_baselines import load, rollout

FIELDS = [field.name for field in dataclasses.fields(Scenario)]

# What is refused, and words that the message must have beside the field's name.
IMPOSSIBLE: list[tuple[dict[str, Any], str]] = [
    ({"num_trackers": 2.0}, "whole"),
    ({"tracker_speed": (1.0, 2.0)}, "2 values for num_trackers=5: give one number, or one for each"),
    ({"tracker_speed": (1.0,) * 4 + (0.0,)}, "tracker_speed[4]=0.0"),
    ({"tracker_speed": 1000.0, "horizon": 4, "settle_time": 0.1}, "physics_step <= 0.0173"),
    ({"tracker_turn_rate": 30.0}, "physics_step"),
    ({"target_motion": "smrat"}, "did you mean 'smart'"),
    ({"target_speed": 1.0}, "0.01 %"),
    ({"target_speed": 1e-300, "target_motion": "smart"}, "constant"),
    ({"wheel_base": 3.0}, "lower it, or tracker_turn_rate"),
    ({"formation_distance": 0.3}, "target"),
    ({"formation_spacing": 0.6}, "tolerance"),
    ({"formation_spacing": 0.9, "robot_radius": 0.5, "formation_distance": 2.0}, "robot_radius"),
    ({"control_step": 0.12}, "physics_step"),
    ({"horizon": 10**6, "tracker_speed": 9.0}, "at most 500 m"),
    ({"arena": 2.0}, "too small"),
    ({"arena": (20.0, math.inf)}, "both be finite"),
    ({"arena": (20.0, 10.0, 5.0)}, "(width, height)"),
    ({"num_obstacles": 3}, "arena"),
    ({"obstacle_radius": (0.8, 0.4)}, "least"),
    ({"start_distance": (0.2, 3.0)}, "clear of the target"),
    ({"breaks": 5}, "num_trackers - 1"),
    ({"breaks": 2, "break_window": (1.0, 1.0)}, "begins too late for breaks=2"),
    ({"extra_fields": ("speed",)}, "in every observation"),
    ({"metrics": ("score", "score")}, "each once"),
    ({"reward_weights": {"slots": 1.0}}, "did you mean 'slot'"),
    ({"target_reward_weights": {"slot": 1.0}}, "'slot' has no formula for a target"),
    ({"target_motion": "unwind"}, "import its module first"),
]


@pytest.mark.parametrize(("settings", "words"), IMPOSSIBLE, ids=lambda part: str(part)[:60])
def test_an_impossible_setting_is_refused_by_name(settings: dict[str, Any], words: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        Scenario(**{"name": "mine", **settings})
    assert next(iter(settings)) in str(refused.value)
    assert words in str(refused.value)


@pytest.mark.parametrize("name", FIELDS)
def test_a_setting_says_what_it_is_and_keeps_to_its_range(name: str) -> None:
    setting = Scenario.settings()[name]
    assert setting.meaning
    assert setting.unit or setting.kind in ("str", "bool")
    for other in (object(), 1j, ({},), np.zeros((2, 2)), {"contact": "much"}):
        with pytest.raises(ScenarioError, match=name):
            Scenario(**{"name": "mine", name: other})  # type: ignore[arg-type]
    for bound, beyond in ((setting.low, -1), (setting.high, 1)):
        if math.isfinite(bound):
            wrong: Any = bound + beyond if abs(bound) < 1e6 else 2 * bound
            if setting.kind == "tuple[float, float]":
                wrong = (wrong, wrong)
            elif setting.kind.startswith("Mapping"):
                wrong = {"contact": wrong}
            with pytest.raises(ScenarioError) as refused:
                Scenario(**{"name": "mine", name: wrong})
            assert name in str(refused.value)
            assert setting.range in str(refused.value)


def test_numbers_of_numpy_are_taken_as_python_s() -> None:
    given: dict[str, Any] = {"num_trackers": np.uint8(2), "tracker_speed": np.array([1.0, 2.0], np.float32)}
    given |= {"arena": np.int16(20), "terminate_on_contact": np.True_, "start_distance": np.array([2, 5])}
    given |= {"target_speed": np.float32(0.5), "reward_weights": {"slot": np.float64(2), "contact": -1}}
    plain: dict[str, Any] = {"num_trackers": 2, "tracker_speed": [1.0, 2.0], "arena": 20, "terminate_on_contact": True}
    plain |= {"start_distance": [2, 5], "target_speed": 0.5, "reward_weights": [("contact", -1), ("slot", 2)]}
    scenario = posse.get_scenario("smart", **given)
    given["reward_weights"]["slot"] = 5.0  # later changes do not reach it
    assert scenario == posse.get_scenario("smart", **plain)
    for name, value in scenario.to_dict().items():
        assert type(value) in (int, float, str, bool, tuple, dict, type(None)), name
    assert {type(each) for each in (*scenario.tracker_speeds, *scenario.start_distance, scenario.arena)} == {float}


def test_equal_sides_are_one_and_an_unknown_setting_is_a_wrong_argument() -> None:
    assert posse.get_scenario("search", arena=(20.0, 20.0)) == posse.get_scenario("search")
    assert posse.get_scenario("field", outage_time=0.01).outage_steps == 1
    with pytest.raises(TypeError, match="unexpected keyword argument 'num_tracker'"):
        posse.get_scenario("smart", num_tracker=3)


# What cannot be drawn, and the words of the message.
TIGHT: list[tuple[dict[str, Any], str]] = [
    ({"num_obstacles": 40}, "place num_obstacles=40 .* enlarge arena"),
    (
        {"arena": 16.0, "num_obstacles": 20, "obstacle_gap": 0.3, "target_turn_rate": 0.2, "target_motion": "smart"},
        "place the target .* raise target_turn_rate",
    ),
    ({"start_distance": (15.0, 15.1)}, "place num_trackers=5 at start_distance=.* widen .* enlarge arena"),
]


@pytest.mark.parametrize(("settings", "words"), TIGHT, ids=str)
def test_a_start_that_cannot_be_drawn_is_an_error_that_changes_nothing(settings: dict[str, Any], words: str) -> None:
    batch = posse.batch("obstacles", 2, **{"target_motion": "agent", **settings})
    before = batch.arrays.copy()
    with pytest.raises(ScenarioError, match=f"could not {words}"):
        batch.reset(seed=3)
    assert all(np.array_equal(*both) for both in zip(before, batch.arrays, strict=True))
    with pytest.raises(ResetNeeded):
        batch.step(np.zeros(batch.action_shape))


@pytest.mark.parametrize("autoreset", ["next_step", "same_step"])
def test_a_later_start_that_cannot_be_drawn_is_an_error_too(autoreset: str) -> None:
    tight: dict[str, Any] = {"num_obstacles": 34, "target_motion": "agent", "start_distance": (1.0, 20.0)}
    batch = posse.batch("obstacles", horizon=2, autoreset=autoreset, **tight)
    batch.reset(seed=0)

    def play() -> None:
        for _ in range(100):  # one start in three fails
            batch.step(np.zeros(batch.action_shape))

    with pytest.raises(ScenarioError, match="could not place num_obstacles=34"):
        play()
    with pytest.raises(ResetNeeded):
        batch.step(np.zeros(batch.action_shape))


@pytest.mark.parametrize("name", posse.scenario_names())
def test_a_named_scenario_is_a_value(name: str) -> None:
    scenario = posse.get_scenario(name)
    assert scenario.meaning.endswith(".")
    with pytest.raises(dataclasses.FrozenInstanceError):
        scenario.num_trackers = 3  # type: ignore[misc]
    twin = Scenario(**scenario.to_dict())
    assert twin == scenario
    assert hash(twin) == hash(scenario)
    assert pickle.loads(pickle.dumps(scenario)) == scenario  # noqa: S301
    assert posse.get_scenario(scenario) is scenario
    larger = posse.get_scenario(name, num_trackers=6)
    assert {k for k, v in larger.to_dict().items() if scenario.to_dict()[k] != v} == {"num_trackers"}
    assert larger.replace(num_trackers=5) == scenario


@pytest.mark.parametrize("name", posse.scenario_names())
def test_its_bound_leaves_room_to_distinguish_teams(name: str) -> None:
    played = rollout(posse.batch(name, 6, seed=5), load("random"))
    assert (played.lengths == posse.get_scenario(name).horizon).all()
    score, bound = played.metrics["score"], played.metrics["bound"]
    assert ((score >= 0) & (score <= bound + 1e-6)).all()
    assert 0.6 < bound.mean() < 0.99


@pytest.mark.parametrize("formation", FORMATIONS)
@pytest.mark.parametrize("motion", ["accelerating", "smart", "agent"])
def test_every_slot_can_be_followed_without_reversing(formation: str, motion: str) -> None:
    batch = posse.batch(num_worlds=4, formation=formation, target_motion=motion, num_trackers=8, horizon=300)
    s = batch.scenario
    batch.reset(seed=1)
    places, most = slots(s), 0.1 * s.slot_turn_rate
    np.testing.assert_allclose([complex(*offset) for offset in s.slot_offsets], places, rtol=1e-9, atol=1e-9)
    apart = np.abs(places[:, None] - places) + np.diag(np.full(8, np.inf))
    assert apart.min() > 2 * s.tolerance
    turned, rng = 0.0, np.random.default_rng(1)
    for k in range(300):
        if k % 20 == 0:
            actions = rng.choice([-1.0, 1.0], batch.action_shape)
            actions[:, -1, 0] = 1.0
        frame = points(batch, "world", "frame_cos", "frame_sin")
        batch.step(actions)
        heading, turned_frame = directions(batch, "world"), points(batch, "world", "frame_cos", "frame_sin")
        # The frame turns towards the heading, at its limit until it is there.
        turn, error = np.angle(turned_frame / frame), np.angle(heading / frame)
        either = np.abs(error) > 3.1
        np.testing.assert_allclose(turn[~either], np.clip(error, -most, most)[~either], rtol=1e-5, atol=1e-5)
        turned = max(turned, float(np.abs(turn).max()))
        if motion != "agent":
            # The velocity of every slot, ahead and aside: never faster than a tracker, never backwards.
            carried = s.target_speed + (1j * turn / 0.1 * turned_frame / heading)[:, None] * places
            assert (np.abs(carried) <= min(s.tracker_speeds)).all()
            assert (carried.real >= -1e-5).all()
    assert turned == pytest.approx(most, rel=1e-3), "the limit was reached"
