"""Invalid input raises an error that names it and the valid range, and changes nothing."""

import math
import re
from typing import Any

import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from hypothesis import given
from hypothesis import strategies as st
from tests.support.attack import LONG_NAME, MAKERS, Subject

import posse
from posse.signals.layout import StateLayout

WHOLE = r"must be a whole number in"

OF_EVERY_KIND: list[tuple[dict[str, Any], str]] = [
    ({"scenario": "smrt"}, r"unknown scenario 'smrt' \(did you mean .*'smart'"),
    ({"scenario": np.zeros(2)}, r"unknown scenario array"),
    ({"num_tracker": 1}, r"unknown setting 'num_tracker'.*did you mean 'num_trackers'"),
    ({"split": "tests"}, r"unknown split .tests.*known: train"),
    ({"split": np.zeros(2)}, r"unknown split array"),
    ({"seed": -1}, rf"seed=-1 {WHOLE} \[0, "),
    ({"first_world": -1}, rf"first_world=-1 {WHOLE}"),
]


@pytest.mark.parametrize(
    ("kind", "arguments", "message"),
    [
        *((kind, *case) for kind in MAKERS if kind != "torchrl" for case in OF_EVERY_KIND),
        ("batch", {"num_worlds": 0}, rf"num_worlds=0 {WHOLE} \[1, "),
        ("batch", {"num_worlds": 2**50}, r"num_worlds=1125899906842624 of \d+ bytes each .*: lower it"),
        ("batch", {"first_world": 2**63 - 1, "num_worlds": 2}, rf"first_world \+ num_worlds - 1=.* {WHOLE}"),
        ("batch", {"clip_actions": "False"}, "clip_actions='False' must be True or False"),
        ("batch", {"num_threads": 0}, rf"num_threads=0 {WHOLE} \[1, "),
        ("batch", {"autoreset": "always"}, "unknown autoreset mode 'always'; known: next_step"),
        ("parallel", {"num_worlds": 4}, "num_worlds= is for many worlds"),
        ("parallel", {"render_mode": "ansi"}, r"unknown render_mode 'ansi'; known: human, rgb_array"),
        ("team", {"discrete_actions": 1}, r"discrete_actions=1 .*True or False"),
        ("team", {"discrete_actions": True, "message_size": 2}, r"message_size=2"),
        ("team", {"target_motion": "agent"}, r"'agent' is not possible.*parallel_env.*target_policy="),
        ("solo", {"num_trackers": 3}, r"num_trackers=3 .*posse/Team-v0"),
        ("solo vector", {"scenario": "leader-loss"}, "breaks=1 of the .* pass breaks=0, or use posse/Team-v0"),
        ("team vector", {"num_envs": 2.5}, rf"num_envs=2\.5 {WHOLE} \[1, "),
        ("team vector", {"num_worlds": 2}, "num_worlds= is not known here: it is num_envs="),
        ("team vector", {"max_episode_steps": 2}, "max_episode_steps= is not known here: it is horizon="),
    ],
    ids=lambda part: str(part)[:60],
)
def test_impossible_settings(kind: str, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(posse.ScenarioError, match=message):
        MAKERS[kind](**arguments)


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


BAD_ACTIONS: list[tuple[bool, Any, str]] = [
    (False, np.array([0, np.nan], np.float32), r"tracker_3: turn rate = nan is not a number in \[-1, 1\]"),
    (False, np.array([0, 0, 0], np.float32), r"tracker_3 has shape \(3,\), wanted \(2,\)"),
    (False, ["left", "right"], r"tracker_3 must be real numbers, got \['left', 'right'\]"),
    (False, [[0], [0, 1]], r"tracker_3 is not an array"),
    (True, 15, r"tracker_3 is 15, outside 0 to 14"),
    (True, 1.0, r"tracker_3 must be whole numbers, got 1\.0"),
]


@pytest.mark.parametrize(("discrete", "action", "message"), BAD_ACTIONS)
def test_a_bad_action_names_its_agent(discrete: bool, action: Any, message: str) -> None:
    env = posse.parallel_env(discrete_actions=discrete)
    env.reset(seed=0)
    before, good = env.state(), dict.fromkeys(env.agents, 2 if discrete else np.array([0, 0], np.float32))
    without = {agent: good[agent] for agent in good if agent != "tracker_2"}
    for actions, words in (
        ({**good, "tracker_3": action}, message),
        (without, r"no action for tracker_2.*agents are: tracker_0,"),
        ({**without, "tracker_9": good["tracker_0"]}, r"unknown agent 'tracker_9'"),
    ):
        with pytest.raises(ValueError, match=words):
            env.step(actions)
        assert np.array_equal(env.state(), before)
    env.step(good)


@pytest.mark.parametrize("kind", MAKERS)
def test_seeds_of_63_bits_are_seeds(kind: str) -> None:
    seeds: list[Any] = [2**63 - 1, np.int64(2**63 - 1), (2**63 - 1) % 2**32]
    subjects = [Subject(kind) for _ in seeds]
    for subject, seed in zip(subjects, seeds, strict=True):
        subject.env.reset(seed=seed)
    drawn = [subject.batch.state["tracker_x"] for subject in subjects]
    assert np.array_equal(drawn[0], drawn[1])
    assert not np.array_equal(drawn[0], drawn[2])


@pytest.mark.parametrize("kind", ["parallel", "team", "solo"])
def test_a_step_needs_an_episode(kind: str) -> None:
    subject = Subject(kind)
    good = subject.good_action(np.random.default_rng(1))
    for call in (subject.env.state, subject.env.render, subject.batch.metrics):
        with pytest.raises(ResetNeeded, match="before reset"):
            call()
    subject.env.reset()
    for _ in range(subject.env.scenario.horizon):
        subject.env.step(good)
    assert "after the end of the episode" in subject.refused(lambda: subject.env.step(good))
    subject.refused(lambda: subject.env.reset(options={"reset_mask": np.zeros(1, np.bool_)}))
    subject.env.reset()
    subject.env.step(good)


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"poses": 1}, "unknown option 'poses'; options are: reset_mask, tracker_pose, target_pose"),
        ({"target_pose": [0.0, 0.0]}, r"target_pose has shape \(2,\)"),
        ({"target_pose": [0.0, math.nan, 0.0]}, "must be finite"),
        ({"target_pose": [1e6, 0.0, 0.0]}, "x lies within ±12 m"),
        ({"tracker_pose": np.zeros((5, 3))}, "tracker_1 of world 0 would start in a wall, an obstacle or another"),
        ({"tracker_pose": [[11.95, k, 0] for k in range(5)]}, "tracker_0 of world 0 would start in a wall"),
        ({"target_pose": [11.5, 0.0, 0.0]}, r"\(11.5, 0, 0\) leaves the target no room to turn: a disc of .* m"),
        ({"reset_mask": [True]}, r"reset_mask must be a bool array of shape \(2,\)"),
        ({"reset_mask": np.array([1, 0])}, "reset_mask must be a bool"),
    ],
    ids=str,
)
def test_bad_options_change_nothing(options: dict[str, Any], word: str) -> None:
    subject = Subject("batch")
    subject.env = subject.batch = posse.batch("field", 2, num_obstacles=0, seed=9)
    subject.env.reset()
    assert re.search(word, subject.refused(lambda: subject.env.reset(seed=1, options=options)))
    assert subject.batch.seed == 9


def test_a_mask_that_chooses_no_world_starts_none() -> None:
    batch = posse.batch("obstacles", 2, seed=1)
    with pytest.raises(ResetNeeded, match="without reset_mask"):
        batch.reset(options={"reset_mask": np.array([True, False])})
    other = posse.batch("obstacles", 2, first_world=10)
    other.reset()
    batch.restore(other.save())
    before = {name: array.copy() for name, array in batch.state.items()}
    batch.reset(seed=5, options={"reset_mask": np.zeros(2, np.bool_), "target_pose": [0.0, 0.0, 0.0]})
    np.testing.assert_equal({**batch.state}, before)


def test_bad_snapshots_and_copies() -> None:
    subject = Subject("batch")
    batch, other = subject.env, posse.batch("constant", 3)
    for call in (batch.save, batch.observe, lambda: batch.copies(1)):
        assert "before reset: call reset() first" in subject.refused(call)
    batch.reset()
    for bad in (None, 5, LONG_NAME, batch.state):
        assert "what save() returned" in subject.refused(lambda bad=bad: batch.restore(bad))
    for count in (0, 2**63, 1.0, None):
        subject.refused(lambda count=count: batch.copies(count))
    for into in (5, LONG_NAME, batch, other):
        subject.refused(lambda into=into: batch.copies(1, into=into))
    assert not other._started
    with pytest.raises(ValueError, match="do not fit: S ="):
        StateLayout(batch.scenario).views(np.zeros((2, 9), np.float32))
