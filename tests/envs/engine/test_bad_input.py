"""Invalid input raises an error that names it and the valid range, and changes nothing."""

from __future__ import annotations

import math
from typing import Any

import gymnasium
import hypothesis
import numpy as np
import pettingzoo
import pytest
from gymnasium.error import ResetNeeded
from hypothesis import given
from hypothesis import strategies as st
from tests.support.adapters import f32

import posse

TEAM, SOLO = "posse/Team-v0", "posse/Solo-v0"

MAKERS: dict[str, Any] = {
    "parallel": posse.parallel_env,
    "turns": posse.env,
    "registry": lambda *a, **k: pettingzoo.make(
        "parallel", "posse/track-v0", **dict(zip(["scenario"], a, strict=False)), **k
    ),
    "team": lambda *a, **k: gymnasium.make(TEAM, **dict(zip(["scenario"], a, strict=False)), **k),
    "solo": lambda *a, **k: gymnasium.make(SOLO, **dict(zip(["scenario"], a, strict=False)), **k),
    "team vector": lambda *a, **k: gymnasium.make_vec(TEAM, 2, **dict(zip(["scenario"], a, strict=False)), **k),
    "solo vector": lambda *a, **k: gymnasium.make_vec(SOLO, 2, **dict(zip(["scenario"], a, strict=False)), **k),
}
makers = pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS.keys())
GOOD = {f"tracker_{i}": f32([0.5, 0.1 * i]) for i in range(5)}


@makers
@pytest.mark.parametrize(
    ("arguments", "settings", "message"),
    [
        (["smrt"], {}, r"unknown scenario 'smrt' \(did you mean .*'smart'"),
        ([], {"num_tracker": 1}, r"unknown setting 'num_tracker'.*did you mean 'num_trackers'"),
        ([], {"num_trackers": 0}, r"num_trackers=0 .*\[1, 64\]|num_trackers=0 does not fit"),
        ([], {"target_speed": 1.0}, r"target_speed=1 must be below tracker_speed=1"),
        ([], {"formation_spacing": 0.1, "num_trackers": 5}, r"slots .* apart|does not fit"),
        ([], {"sensing_range": -1.0}, r"sensing_range=-1\.0 .*\(0, 10000\], or be inf"),
        ([], {"split": "tests"}, r"unknown split 'tests'; splits are: train"),
        ([], {"seed": -1}, r"seed=-1 must be a whole number"),
        ([], {"first_world": -1}, r"first_world=-1 must be a whole number"),
        ([], {"discrete_actions": 1}, r"discrete_actions=1 .*True or False"),
        ([], {"discrete_actions": True, "message_size": 2}, r"message_size=2"),
    ],
)
def test_impossible_settings(make: Any, arguments: list[str], settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make(*arguments, **settings)


@pytest.mark.parametrize("make", [MAKERS["parallel"], MAKERS["turns"]])
@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"target": "smart"}, r"target='smart' .*'agent'"),
        ({"target": "agent", "target_motion": "smart"}, r"exclude each other"),
        ({"max_cycles": 0}, r"horizon=0"),
        ({"render_mode": "ansi"}, r"unknown render_mode 'ansi'; modes are: human, rgb_array"),
    ],
)
def test_impossible_settings_of_pettingzoo(make: Any, settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make(**settings)


@pytest.mark.parametrize("kind", ["team", "solo", "team vector", "solo vector"])
def test_a_target_that_is_an_agent_needs_pettingzoo(kind: str) -> None:
    for settings in ({"target": "agent"}, {"target_motion": "agent"}):
        with pytest.raises(posse.ScenarioError, match=r"'agent' is not possible.*parallel_env"):
            MAKERS[kind](**settings)


@pytest.mark.parametrize("kind", ["solo", "solo vector"])
def test_a_solo_is_for_one_tracker(kind: str) -> None:
    with pytest.raises(posse.ScenarioError, match=r"num_trackers=3 .*posse/Team-v0"):
        MAKERS[kind](num_trackers=3)
    with pytest.raises(posse.ScenarioError, match="breaks=1"):
        MAKERS[kind]("leader-loss")


def test_impossible_settings_of_vector_environments() -> None:
    with pytest.raises(ValueError, match=r"unknown autoreset_mode 'Never'.*'NextStep'"):
        gymnasium.make_vec(TEAM, 2, autoreset_mode="Never")
    with pytest.raises(ValueError, match=r"num_worlds=0"):
        gymnasium.make_vec(TEAM, 0)
    with pytest.raises(ValueError, match=r"unknown render_mode 'ansi'"):
        gymnasium.make_vec(TEAM, 2, render_mode="ansi")
    with pytest.raises(ValueError, match=r"horizon=0"):
        gymnasium.make_vec(TEAM, 2, max_episode_steps=0)


BAD_ACTIONS: list[tuple[Any, str]] = [
    (f32([0, np.nan]), r"tracker_3: turn rate = nan is not a number in \[-1, 1\]"),
    (f32([np.inf, 0]), r"tracker_3: speed = inf"),
    (f32([0, -1.5]), r"tracker_3: turn rate = -1\.5"),
    ([0.0, 1.0001], r"tracker_3: turn rate = 1\.0001"),
    (f32([0, 0, 0]), r"tracker_3 has shape \(3,\), wanted \(2,\)"),
    (np.float32(0), r"tracker_3 has shape \(\), wanted \(2,\)"),
    (f32([[0, 0]]), r"tracker_3 has shape \(1, 2\), wanted \(2,\)"),
    (["left", "right"], r"tracker_3 must be real numbers, got \['left', 'right'\]"),
    (np.array([1j, 0]), r"tracker_3 must be real numbers"),
    (None, r"tracker_3 must be real numbers, got None"),
    ([[0], [0, 1]], r"tracker_3 is not an array"),
]


@hypothesis.settings(deadline=None)
@given(
    number=st.integers(0, 37 * 5 * 2 - 1),
    value=st.sampled_from([math.nan, math.inf, -math.inf, 1.00001, -1.00001, 3.0]),
    later=st.integers(0, 37 * 5 * 2 - 1),
)
def test_the_first_bad_action_is_named_wherever_it_stands(number: int, value: float, later: int) -> None:
    """Also beyond the last whole block of actions that are checked at once."""
    batch = posse.batch("constant", 37)
    batch.reset(seed=8)
    actions = np.zeros((37, 5, 2), np.float32)
    actions.reshape(-1)[[max(number, later), number]] = 2.0, value
    e, i, k = np.unravel_index(number, actions.shape)
    with pytest.raises(ValueError, match=rf"actions\[{e}, {i}, {k}\] = "):
        batch.step(actions)
    actions.reshape(-1)[[max(number, later), number]] = 0.5, math.copysign(1 + 5e-7, value)
    twin = posse.batch("constant", 37)
    twin.reset(seed=8)
    mine = batch.step(actions)[0]
    np.testing.assert_array_equal(mine, twin.step(actions.clip(-1, 1))[0])


@pytest.mark.parametrize(("action", "message"), BAD_ACTIONS)
def test_a_bad_action_names_its_agent(action: Any, message: str) -> None:
    env = posse.parallel_env()
    env.reset(seed=0)
    before = env.state()
    with pytest.raises(ValueError, match=message):
        env.step({**GOOD, "tracker_3": action})
    assert np.array_equal(env.state(), before)
    env.step(GOOD)


def test_all_agents_must_act_and_no_others() -> None:
    env = posse.parallel_env()
    env.reset(seed=0)
    before = env.state()
    without = {agent: action for agent, action in GOOD.items() if agent != "tracker_2"}
    with pytest.raises(ValueError, match=r"no action for tracker_2.*agents are: tracker_0,"):
        env.step(without)
    with pytest.raises(ValueError, match=r"unknown agent 'target_0'; agents are: tracker_0,"):
        env.step({**GOOD, "target_0": np.zeros(2, np.float32)})
    with pytest.raises(ValueError, match=r"unknown agent 'tracker_9'"):
        env.step({**without, "tracker_9": np.zeros(2, np.float32)})
    for actions in (np.zeros((5, 2), np.float32), None, [0.0] * 5):
        with pytest.raises(ValueError, match="dictionary by agent"):
            env.step(actions)  # type: ignore[arg-type]
    assert np.array_equal(env.state(), before)


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (15, r"tracker_3 is 15, outside 0 to 14"),
        (-1, r"tracker_3 is -1, outside 0 to 14"),
        (1.0, r"tracker_3 must be a whole number, got 1\.0"),
        (f32([0, 0]), r"tracker_3 must be a whole number"),
        ([3], r"tracker_3 has shape \(1,\), wanted \(\)"),
    ],
)
def test_a_bad_discrete_action_names_its_agent(action: Any, message: str) -> None:
    env = posse.parallel_env(discrete_actions=True)
    env.reset(seed=0)
    before = env.state()
    with pytest.raises(ValueError, match=message):
        env.step({**dict.fromkeys(GOOD, 2), "tracker_3": action})
    assert np.array_equal(env.state(), before)


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (np.zeros((4, 2), np.float32), r"shape \(4, 2\), wanted \(5, 2\)"),
        (np.zeros(10, np.float32), r"shape \(10,\), wanted \(5, 2\)"),
        (np.full((5, 2), np.nan, np.float32), r"tracker_0: speed = nan"),
        (np.eye(5, 2) * 1.5, r"tracker_0: speed = 1\.5"),
        (np.zeros((5, 2), np.complex64), r"tracker_0 must be real numbers"),
        ("rest", r"shape \(\), wanted"),
        ([[0, 0]] * 4 + [[0]], r"action is not an array"),
    ],
)
def test_a_bad_action_of_a_team(action: Any, message: str) -> None:
    env = gymnasium.make(TEAM).unwrapped
    env.reset(seed=0)
    before = env.state()  # type: ignore[attr-defined]
    with pytest.raises(ValueError, match=message):
        env.step(action)
    assert np.array_equal(env.state(), before)  # type: ignore[attr-defined]
    env.step(np.zeros((5, 2), np.float32))


def test_a_bad_action_of_a_solo() -> None:
    env = gymnasium.make(SOLO).unwrapped
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"tracker_0: speed = -2\.0"):
        env.step(f32([-2, 0]))
    with pytest.raises(ValueError, match=r"shape \(1, 2\), wanted \(2,\)"):
        env.step(f32([[0, 0]]))


def test_bad_actions_of_vector_environments() -> None:
    env = gymnasium.make_vec(TEAM, 3)
    env.reset(seed=0)
    state = env.batch.save()  # type: ignore[attr-defined]
    good = np.zeros((3, 5, 2), np.float32)
    bad = good.copy()
    bad[2, 4, 1] = np.nan
    for actions, message in (
        (bad, r"actions\[2, 4, 1\] = nan is not a number in \[-1, 1\]"),
        (good[:2], r"shape \(2, 5, 2\), wanted \(3, 5, 2\)"),
        (good.astype(str), r"real numbers"),
        (None, r"shape \(\), wanted"),
    ):
        with pytest.raises(ValueError, match=message):
            env.step(actions)
    for mine, other in zip(
        env.batch.arrays,  # type: ignore[attr-defined]
        state.arrays,
        strict=True,
    ):
        assert np.array_equal(mine, other)
    discrete = gymnasium.make_vec(TEAM, 3, discrete_actions=True)
    discrete.reset(seed=0)
    numbers = np.zeros((3, 5), np.int64)
    numbers[1, 2] = 15
    with pytest.raises(ValueError, match=r"actions\[1, 2\] = 15 lies outside 0 to 14"):
        discrete.step(numbers)
    with pytest.raises(ValueError, match=r"whole numbers, got an array of float64"):
        discrete.step(np.zeros((3, 5)))


def test_a_step_needs_an_episode() -> None:
    parallel = posse.parallel_env(max_cycles=1)
    team = gymnasium.make(TEAM, horizon=1, settle_time=0.1).unwrapped
    solo = gymnasium.make(SOLO, horizon=1, settle_time=0.1).unwrapped
    rest = np.zeros((5, 2), np.float32)
    cases: list[tuple[Any, Any]] = [(parallel, GOOD), (team, rest), (solo, rest[0])]
    for env, action in cases:
        with pytest.raises(ResetNeeded, match="step before reset"):
            env.step(action)
        env.reset()
        env.step(action)
        with pytest.raises(ResetNeeded, match="step after the end of the episode"):
            env.step(action)
        env.reset()
        env.step(action)


def test_a_vector_step_needs_an_episode() -> None:
    env = gymnasium.make_vec(TEAM, 2, max_episode_steps=1, autoreset_mode="Disabled")
    rest = np.zeros((2, 5, 2), np.float32)
    with pytest.raises(ResetNeeded, match="before reset"):
        env.step(rest)
    env.reset()
    env.step(rest)
    with pytest.raises(ResetNeeded, match="after the end of world 0 and 1 more"):
        env.step(rest)


def test_state_and_pictures_need_a_reset() -> None:
    for env in (posse.parallel_env(), gymnasium.make(TEAM).unwrapped):
        with pytest.raises(ResetNeeded, match="state before reset"):
            env.state()  # type: ignore[union-attr]
        with pytest.raises(ResetNeeded, match="render before reset"):
            env.render()


@pytest.mark.parametrize("kind", ["parallel", "team", "solo"])
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"seed": -1}, r"seed=-1"),
        ({"seed": 1.5}, r"seed=1\.5"),
        ({"options": {"tracker_poses": 1}}, r"unknown option 'tracker_poses'; options are"),
        ({"options": {"reset_mask": np.array([True])}}, r"unknown option 'reset_mask'"),
        ({"options": {"target_pose": [0, 0]}}, r"target_pose has shape \(2,\)"),
        ({"options": {"target_pose": [0, 0, np.nan]}}, r"target_pose must be finite"),
        ({"options": {"target_pose": [1e6, 0, 0]}}, r"target_pose lies up to"),
    ],
)
def test_a_bad_reset_changes_nothing(kind: str, arguments: dict[str, Any], message: str) -> None:
    env = MAKERS[kind]()
    env = env if kind == "parallel" else env.unwrapped
    env.reset(seed=0)
    before = env.state()
    with pytest.raises(ValueError, match=message):
        env.reset(**arguments)
    assert np.array_equal(env.state(), before)
    # Nor what comes next.
    twin = MAKERS[kind]()
    twin.reset(seed=0)
    env.reset()
    twin.reset()
    other = twin if kind == "parallel" else twin.unwrapped
    assert np.array_equal(env.state(), other.state())


@pytest.mark.parametrize("kind", ["parallel", "turns", "team", "solo", "team vector"])
def test_a_target_without_room_to_turn_is_refused_and_changes_nothing(kind: str) -> None:
    made = [MAKERS[kind]("search", num_trackers=1, start_distance=(2.0, 4.0)) for _ in range(2)]
    env, twin = ((e if kind in ("parallel", "turns") else e.unwrapped) for e in made)
    env.reset(seed=0)
    twin.reset(seed=0)
    facing_the_wall = {"target_pose": [9.5, 1.0, 0.0], "tracker_pose": [[0.0, 0.0, 0.0]]}
    with pytest.raises(
        ValueError,
        match=r"target_pose \(9\.5, 1, 0\) leaves the target no room to turn: a disc of 0\.75 m .*"
        r"0\.5 m are: move it or turn it",
    ):
        env.reset(options=facing_the_wall)
    for one in (env, twin):
        one.reset()
    if kind == "team vector":
        assert np.array_equal(env.batch.worlds["x"], twin.batch.worlds["x"])
    else:
        assert np.array_equal(env.state(), twin.state())
    along_the_wall = {**facing_the_wall, "target_pose": [9.5, 1.0, np.pi / 2]}
    env.reset(options=along_the_wall)


def test_a_bad_vector_reset() -> None:
    env = gymnasium.make_vec(TEAM, 2)
    with pytest.raises(ResetNeeded, match="without reset_mask"):
        env.reset(options={"reset_mask": np.array([True, False])})
    env.reset(seed=0)
    for options, message in (
        ({"reset_mask": [True]}, r"reset_mask must be a bool array of shape \(2,\)"),
        ({"mask": 1}, "unknown option 'mask'"),
    ):
        with pytest.raises(ValueError, match=message):
            env.reset(options=options)
    with pytest.raises(ValueError, match="seed must be one number"):
        env.reset(seed=[1, 2])  # type: ignore[arg-type]
