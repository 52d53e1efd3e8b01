"""Scenarios: values, overrides, and errors for invalid settings."""

from __future__ import annotations

import dataclasses
import math
import pickle
from typing import Any

import hypothesis
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import posse
from posse import Scenario, ScenarioError
from posse.signals.global_state import StateLayout

WALLED = {"arena": 20.0}

# What is refused, and a word that the message must have beside the field's name.
IMPOSSIBLE: list[tuple[dict[str, Any], str]] = [
    ({"num_trackers": 0}, "1, 64"),
    ({"num_trackers": 65}, "1, 64"),
    ({"num_trackers": 2.0}, "whole"),
    ({"num_trackers": True}, "whole"),
    ({"version": 0}, "1"),
    ({"name": 3}, "string"),
    ({"tracker_speed": 0.0}, "0.001"),
    ({"tracker_speed": -1.0}, "0.001"),
    ({"tracker_speed": math.nan}, "number"),
    ({"tracker_speed": "fast"}, "number"),
    ({"tracker_speed": math.inf}, "finite"),
    ({"tracker_speed": 10**400}, "number"),
    ({"tracker_turn_rate": 0.0}, "0.001"),
    ({"tracker_turn_rate": 30.0}, "physics_step"),
    ({"tracker_turn_rate": 0.001, "physics_step": 1e-3}, ">= 0.00191"),
    ({"tracker_speed": 1000.0, "horizon": 10, "settle_time": 0.1}, "physics_step <= 0.0173"),
    ({"tracker_speed": 30.0, "robot_radius": 0.001, **WALLED}, "physics_step <= 0.0471"),
    ({"tracker_speed": 0.001, "target_speed": 0.0005, "physics_step": 1e-3}, ">= 0.0305"),
    ({"tracker_acceleration": 0.0}, "0.001"),
    ({"tracker_acceleration": 0.001, "tracker_speed": 9.0, "physics_step": 0.01}, "0.00153"),
    ({"tracker_acceleration": 1e39}, "[0.001, 1e+06], or be inf"),
    ({"tracker_turn_acceleration": 0.001, "physics_step": 0.001}, ">= 0.00381"),
    ({"tracker_turn_acceleration": -1.0}, "0.001"),
    ({"robot_radius": 0.0}, "0.001"),
    ({"target_motion": "smrat"}, "smart"),
    ({"target_speed": 1.0}, "tracker_speed"),
    ({"target_speed": 1.5}, "tracker_speed"),
    ({"target_speed": 0.99995}, "0.01 %"),
    ({"target_speed": 1e-300}, ">= 0.00244"),
    ({"target_speed": -0.1}, "0"),
    ({"target_speed": 0.0, "target_motion": "smart"}, "constant"),
    ({"target_turn_rate": 0.0}, "0.001"),
    ({"target_turn_rate": 21.0}, "physics_step"),
    ({"formation": "vedge"}, "wedge"),
    ({"formation_distance": 0.0}, "0"),
    ({"formation_distance": 0.3}, "target"),
    ({"formation_spacing": 0.6}, "tolerance"),
    ({"formation_spacing": 0.9, "robot_radius": 0.5, "formation_distance": 2.0}, "robot_radius"),
    ({"formation_spacing": math.inf}, "finite"),
    ({"formation_spacing": 9000.0}, "at most 2000 m"),
    ({"tolerance": 0.6}, "formation_spacing"),
    ({"settle_time": 61.0}, "horizon=600 steps of 0.1 s"),
    ({"horizon": 5, "settle_time": 3.0}, "settle_time=3.0"),
    ({"settle_time": 0.0}, "0"),
    ({"control_step": 0.12}, "physics_step"),
    ({"control_step": 0.01}, "physics_step"),
    ({"physics_step": 0.0}, "0.0001"),
    ({"physics_step": 1e-310}, "0.0001"),
    ({"horizon": 0}, "1"),
    ({"horizon": 1.5}, "whole"),
    ({"horizon": 10**6, "tracker_speed": 9.0}, "origin"),
    ({"terminate_on_contact": 1}, "True or False"),
    ({"arena": -5.0}, "0"),
    ({"arena": 5.0}, "too small"),
    ({"arena": 7e5}, "(0, 4000], or be inf"),
    ({"num_obstacles": 3}, "arena"),
    ({"num_obstacles": 61, **WALLED}, "60"),
    ({"num_obstacles": 30, **WALLED}, "fit"),
    ({"num_obstacles": 8, "arena": 22.0, "target_turn_rate": 0.2}, "to turn"),
    ({"obstacle_radius": (0.0, 0.0), "num_obstacles": 1, **WALLED}, "above 0"),
    ({"obstacle_radius": (0.8, 0.4)}, "least"),
    ({"obstacle_radius": [0.4, 0.8]}, "tuple"),
    ({"obstacle_radius": (0.4, math.inf)}, "tuple"),
    ({"obstacle_radius": (0.4, 1e200)}, "[0, 10000]"),
    ({"obstacle_gap": -0.1}, "0"),
    ({"start_distance": (0.2, 3.0)}, "clear of the target"),
    ({"start_distance": (4.0, 4.1), "num_trackers": 30}, "fit"),
    ({"start_distance": (4.0, 4.01), "num_trackers": 64, "arena": 40.0}, "fit"),
    ({"start_distance": (4.0, 1e20)}, "[0, 2000]"),
    ({"start_distance": 4.0}, "tuple"),
    ({"sensing_range": 0.0}, "0"),
    ({"sensing_range": -1.0}, "0"),
    ({"sensing_range": 1e308}, "(0, 1e+06], or be inf"),
    ({"field_of_view": 0.0}, "0"),
    ({"field_of_view": 7.0}, "6.28"),
    ({"range_noise": -0.1}, "0"),
    ({"range_noise": 0.5}, "0.3"),
    ({"bearing_noise": 1.0}, "0.5"),
    ({"velocity_smoothing": -1.0}, "0"),
    ({"velocity_smoothing": 1e300}, "[0, 10000]"),
    ({"sonar_beams": 65}, "64"),
    ({"sonar_range": 0.0}, "0.001"),
    ({"radio_range": -1.0}, "0"),
    ({"radio_range": 1e200}, "(0, 1e+06], or be inf"),
    ({"radio_delay": -1}, "0"),
    ({"radio_delay": 0.5}, "whole"),
    ({"radio_loss": 1.0}, "0.999"),
    ({"message_size": -1}, "0"),
    ({"message_size": 65}, "64"),
    ({"forget_after": 0.0}, "0"),
    ({"num_neighbours": 64}, "63"),
    ({"num_neighbours": -1}, "0"),
    ({"num_neighbours": 2.5}, "whole"),
    ({"breaks": 5}, "num_trackers - 1"),
    ({"breaks": -1}, "0"),
    ({"break_choice": "neares"}, "nearest"),
    ({"sensor": "range-bearings"}, "range-bearing"),
    ({"metrics": ["scor"]}, "score"),
    ({"metrics": 5}, "tuple of names"),
    ({"extra_fields": 5}, "tuple of names"),
    ({"breaks": 2, "break_choice": "given"}, "break_number"),
    ({"break_number": 5, "break_choice": "given", "breaks": 1}, "0 to 4"),
    ({"break_window": (0.5, 1.5)}, "0, 1"),
    ({"sensor_outages": 1.1}, "1"),
    ({"radio_outages": -0.1}, "0"),
    ({"outage_time": 0.0}, "0"),
    ({"reward_weights": {"slots": 1.0}}, "slot"),
    ({"reward_weights": {"slot": math.nan}}, "finite"),
    ({"reward_weights": {"slot": -1e300}}, "[-1e+06, 1e+06]"),
    ({"reward_weights": {"slot": "much"}}, "number"),
    ({"reward_weights": 3}, "terms"),
    ({"reward_weights": {1: 1.0, "slot": 1.0}}, "terms"),
    ({"target_least_speed": 0.7}, "at most target_speed=0.6"),
    ({"target_reward_weights": {"slot": 1.0}}, "trackers only"),
    ({"target_reward_weights": {"teams": 1.0}}, "team"),
]


@pytest.mark.parametrize(("settings", "word"), IMPOSSIBLE, ids=lambda part: str(part)[:60])
def test_an_impossible_setting_is_refused_by_name(settings: dict[str, Any], word: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        Scenario(name="mine", **settings) if "name" not in settings else Scenario(**settings)
    first = next(iter(settings))
    assert first in str(refused.value)
    assert word in str(refused.value)
    with pytest.raises(ScenarioError):
        posse.batch("constant", **settings)


def test_every_field_has_an_impossible_value_among_the_tests() -> None:
    tried = {next(iter(settings)) for settings, _ in IMPOSSIBLE}
    assert tried == {field.name for field in dataclasses.fields(Scenario)}


VALUES = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-3, 100),
    st.integers(),
    st.floats(),
    st.text(max_size=5),
    st.tuples(st.floats(0, 10), st.floats(0, 10)),
    st.lists(st.integers(), max_size=3),
    st.dictionaries(st.text(max_size=3), st.floats(), max_size=2),
    st.just(10**400),
)


@hypothesis.settings(derandomize=True, max_examples=200, deadline=None)
@given(
    name=st.sampled_from(posse.scenario_names()),
    overrides=st.dictionaries(
        st.sampled_from([field.name for field in dataclasses.fields(Scenario)]), VALUES, min_size=1, max_size=3
    ),
)
def test_nothing_but_a_scenario_error_is_ever_raised(name: str, overrides: dict[str, Any]) -> None:
    try:
        scenario = posse.get_scenario(name, **overrides)
    except ScenarioError:
        return
    # What passes can be turned into what the kernels read, without a number lost.
    layout = posse.ObservationLayout(scenario)
    assert all(np.isfinite(bound).all() for bound in layout.bounds())
    assert 0 <= scenario.slot_turn_rate < math.inf


def wide(least: float, most: float, *more: float) -> st.SearchStrategy[float]:
    """Numbers of every order of magnitude, and some more."""
    orders = st.floats(math.log10(least), math.log10(most)).map(lambda order: 10**order)
    return st.one_of(orders, orders, orders, st.sampled_from([least, most, *more]))


@st.composite
def wide_settings(draw: st.DrawFn) -> dict[str, Any]:
    """Settings of which many are possible, up to where they no longer are."""
    physics_step = draw(wide(1e-4, 10, 0.05))
    least = draw(wide(0.5, 3000, 4.0))
    radius = draw(wide(1e-3, 10, 0.0))
    speed = draw(wide(1e-3, 1000, 1.0))
    chosen: dict[str, Any] = {
        "tracker_speed": speed,
        "target_speed": speed * draw(st.sampled_from([1e-6, 0.01, 0.6, 0.9999])),
        "tracker_turn_rate": draw(wide(1e-3, 1e4)),
        "target_turn_rate": draw(wide(1e-3, 1e4)),
        "tracker_acceleration": draw(wide(1e-3, 1e308, math.inf)),
        "tracker_turn_acceleration": draw(wide(1e-3, 1e308, math.inf)),
        "robot_radius": draw(wide(1e-3, 1)),
        "physics_step": physics_step,
        "control_step": physics_step * draw(st.integers(1, 5)),
        "tolerance": draw(wide(1e-3, 1)),
        "formation_distance": draw(wide(0.1, 1e4)),
        "formation_spacing": draw(wide(0.1, 1e4)),
        "start_distance": (least, least * draw(wide(1.001, 10))),
        "arena": draw(wide(1, 1e4, math.inf)),
        "num_obstacles": draw(st.integers(0, 5)),
        "obstacle_radius": (radius / 2, radius),
        "sensing_range": draw(wide(1e-3, 1e308, math.inf)),
        "radio_range": draw(wide(1e-3, 1e308, math.inf)),
        "range_noise": draw(st.sampled_from([0.0, 0.3])),
        "bearing_noise": draw(st.sampled_from([0.0, 0.5])),
        "velocity_smoothing": draw(wide(1e-300, 1e308, 0.0)),
        "sonar_range": draw(wide(1e-3, 1e4)),
        "reward_weights": {name: draw(wide(1e-30, 1e300)) for name in ("distance", "contact")},
    }
    names = draw(st.sets(st.sampled_from(sorted(chosen)), min_size=1))
    return {name: chosen[name] for name in names}


@hypothesis.settings(
    derandomize=True, max_examples=100, deadline=None, suppress_health_check=[hypothesis.HealthCheck.filter_too_much]
)
@given(
    name=st.sampled_from(posse.scenario_names()),
    target_motion=st.sampled_from(["constant", "accelerating", "smart", "agent"]),
    num_trackers=st.sampled_from([2, 5, 9]),
    chosen=wide_settings(),
)
def test_what_is_allowed_is_finite_and_within_its_bounds(name: str, chosen: dict[str, Any], **settings: Any) -> None:
    try:
        batch = posse.batch(name, 3, **settings, horizon=30, settle_time=1e-6, **chosen)
    except ScenarioError:
        hypothesis.reject()
    state = StateLayout(batch.scenario)
    bounds = [batch.layout.bounds(), state.bounds()]
    observations = batch.reset(seed=1)
    rng = np.random.default_rng(1)
    total = np.zeros(batch.observation_shape[:2], np.float32)
    for _ in range(35):
        vectors = [observations, state.vector(batch.arrays)]
        for (low, high), vector in zip(bounds, vectors, strict=True):
            outside = (vector < low) | (vector > high) | ~np.isfinite(vector)
            assert not outside.any(), np.argwhere(outside)
        actions = rng.choice([-1, 0.5, 1], batch.action_shape)
        observations, rewards, *_ = batch.step(actions)
        total += rewards
        assert np.isfinite(total).all()


@hypothesis.settings(derandomize=True, max_examples=40, deadline=None)
@given(
    name=st.sampled_from(posse.scenario_names()),
    target_motion=st.sampled_from(["constant", "accelerating", "smart", "agent"]),
    formation=st.sampled_from(["wedge", "ring", "rows"]),
    tracker_speed=st.sampled_from([0.01, 0.7, 1.0, 20.0, 500.0]),
    target_share=st.sampled_from([0.1, 0.6, 0.99, 0.9999]),
    turn_rate=st.sampled_from([0.001, 0.5, 2.0, 19.0]),
    robot_radius=st.sampled_from([0.001, 0.15, 0.25]),
    breaks=st.integers(0, 3),
    num_trackers=st.sampled_from([1, 2, 5, 9]),
)
def test_what_is_allowed_runs_and_stays_finite(
    name: str, tracker_speed: float, target_share: float, turn_rate: float, **overrides: Any
) -> None:
    try:
        batch = posse.batch(
            name,
            2,
            tracker_speed=tracker_speed,
            target_speed=tracker_speed * target_share,
            tracker_turn_rate=turn_rate,
            target_turn_rate=turn_rate,
            horizon=40,
            **overrides,
        )
    except ScenarioError:
        return
    observations = batch.reset(seed=1)
    rng = np.random.default_rng(1)
    for _ in range(40):
        assert np.isfinite(observations).all()
        observations, rewards, *_ = batch.step(rng.uniform(-1, 1, batch.action_shape))
        assert np.isfinite(rewards).all()
    for key, array in batch.state.items():
        assert np.isfinite(array).all(), key


def test_unknown_names_name_the_near_ones() -> None:
    with pytest.raises(ScenarioError, match="did you mean 'smart'"):
        posse.get_scenario("smrt")
    with pytest.raises(ScenarioError, match="did you mean 'num_trackers'"):
        posse.get_scenario("smart", num_tracker=3)
    with pytest.raises(ScenarioError, match="scenarios are: constant"):
        posse.batch("nothing like it")


@pytest.mark.parametrize("name", posse.scenario_names())
def test_a_named_scenario_is_a_value(name: str) -> None:
    scenario = posse.get_scenario(name)
    assert scenario.name == name
    assert scenario.version >= 1
    with pytest.raises(dataclasses.FrozenInstanceError):
        scenario.num_trackers = 3  # type: ignore[misc]
    twin = Scenario(**scenario.to_dict())
    assert twin == scenario
    assert hash(twin) == hash(scenario)
    assert pickle.loads(pickle.dumps(scenario)) == scenario  # noqa: S301
    assert posse.get_scenario(scenario) is scenario
    larger = posse.get_scenario(name, num_trackers=6)
    assert larger != scenario
    assert larger.num_trackers == 6
    assert scenario.num_trackers == 5, "the named one is as it was"
    assert larger.replace(num_trackers=5) == scenario


def test_all_the_scenarios_that_the_benchmark_names_are_there() -> None:
    assert set(posse.scenario_names()) == {
        "constant",
        "accelerating",
        "smart",
        "search",
        "obstacles",
        "radio",
        "leader-loss",
        "field",
        "duel",
        "paper-centralized",
        "paper-distributed",
    }


def test_reward_weights_compare_whatever_their_order_and_kind() -> None:
    weights = {"slot": 1.0, "contact": -1.0}
    one = Scenario(name="mine", reward_weights=weights)
    other = Scenario(name="mine", reward_weights=(("contact", -1.0), ("slot", 1.0)))
    assert one == other
    assert one.to_dict()["reward_weights"] == weights
    weights["slot"] = 5.0
    assert dict(one.reward_weights)["slot"] == 1.0, "nothing outside can change it"


@pytest.mark.parametrize("number", [1, 2, 64])
@pytest.mark.parametrize("name", posse.scenario_names())
def test_one_to_sixty_four_trackers_in_every_scenario(name: str, number: int) -> None:
    overrides: dict[str, Any] = {"breaks": 0} if number == 1 else {}
    if number == 64 and math.isinf(posse.get_scenario(name).arena):
        overrides["start_distance"] = (1.5, 12.0)
    batch = posse.batch(name, 1, num_trackers=number, **overrides)
    observations = batch.reset(seed=0)
    assert np.isfinite(observations).all()
    assert np.isfinite(batch.step(np.zeros(batch.action_shape))[0]).all()


def test_a_limit_may_be_one_number_or_one_for_each_tracker() -> None:
    each = posse.get_scenario("smart", num_trackers=3, tracker_speed=[1.0, 0.8, 1.5])
    assert each.tracker_speed == (1.0, 0.8, 1.5)
    assert each.tracker_speeds == (1.0, 0.8, 1.5)
    assert posse.get_scenario("smart", num_trackers=3).tracker_speeds == (1.0, 1.0, 1.0)
    assert each.slot_turn_rate < posse.get_scenario("smart", num_trackers=3).slot_turn_rate
    assert each.position_bound > posse.get_scenario("smart", num_trackers=3).position_bound


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"tracker_speed": (1.0, 2.0)}, "2 values for num_trackers=5: give one number, or one for"),
        ({"tracker_turn_rate": (1.0,) * 4 + (0.0,)}, r"tracker_turn_rate\[4\]=0.0"),
        ({"tracker_speed": (1.0,) * 4 + (0.5,)}, "must be below tracker_speed=0.5"),
        ({"tracker_speed": (1.0,) * 4 + ("fast",)}, r"tracker_speed\[4\]='fast'.* a number"),
        ({"tracker_acceleration": (1.0,) * 5}, "tracker_acceleration=.* it must be a number"),
    ],
)
def test_limits_of_each_tracker_are_checked(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        posse.get_scenario("smart", **settings)


def test_every_setting_says_what_it_is() -> None:
    for name, setting in posse.Scenario.settings().items():
        assert setting.meaning, name
        assert setting.unit or setting.kind in ("text", "flag"), name
        if setting.kind in ("number", "whole"):
            default = getattr(posse.get_scenario("constant"), name)
            assert default is None or setting.low <= default, name
