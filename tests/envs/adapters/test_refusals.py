"""Invalid input raises a documented error in every environment, and nothing changes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from tests.support.attack import BAD_OPTIONS, BAD_SEEDS, LONG_NAME, MAKERS, Subject, unchanged

import posse

kinds = pytest.mark.parametrize("kind", MAKERS)
LONGEST_MESSAGE = 1000


def refused(subject: Subject, call: Any, *errors: type[Exception]) -> str:
    """Return the message of a refused call, after checking that it changed nothing."""
    before = subject.held()
    with pytest.raises(errors or ValueError) as caught:
        call()
    assert unchanged(before, subject.held())
    message = str(caught.value)
    assert 0 < len(message) <= LONGEST_MESSAGE
    assert "\0" not in message
    return message


@kinds
@pytest.mark.parametrize("started", [False, True])
def test_bad_seeds_and_options_change_nothing(kind: str, started: bool) -> None:
    subject = Subject(kind)
    if started:
        subject.reset(seed=1)
        subject.step(subject.good_action(np.random.default_rng(1)))
    for seed in BAD_SEEDS:
        if isinstance(seed, list) and "vector" in kind:
            continue  # named by another message
        message = refused(subject, lambda seed=seed: subject.reset(seed=seed))
        assert message.startswith("seed=")
        assert "[0, 2**63)" in message
    for options in BAD_OPTIONS:
        refused(subject, lambda options=options: subject.reset(options=options))


@kinds
def test_bad_actions_change_nothing(kind: str) -> None:
    subject = Subject(kind)
    subject.reset(seed=1)
    for action in subject.bad_actions():
        refused(subject, lambda action=action: subject.step(action))
    subject.step(subject.good_action(np.random.default_rng(1)))


@kinds
def test_a_refused_first_reset_leaves_an_environment_that_needs_one(kind: str) -> None:
    subject = Subject(kind)
    refused(subject, lambda: subject.reset(seed=-1))
    action = None if kind == "turns" else subject.good_action(np.random.default_rng(1))
    assert "step before reset" in refused(subject, lambda: subject.step(action), ResetNeeded)
    subject.reset()
    subject.step(subject.good_action(np.random.default_rng(1)))


@kinds
@pytest.mark.parametrize("seed", [2**40, 2**63 - 1, np.int64(2**40)])
def test_seeds_of_63_bits_are_seeds(kind: str, seed: Any) -> None:
    one, other, nearby = Subject(kind), Subject(kind), Subject(kind)
    one.reset(seed=seed)
    other.reset(seed=int(seed))
    nearby.reset(seed=int(seed) % 2**32)
    drawn = [subject.batch.state["tracker_x"] for subject in (one, other, nearby)]
    assert np.array_equal(drawn[0], drawn[1])
    assert not np.array_equal(drawn[0], drawn[2])


def test_seeds_of_torchrl_are_checked_when_they_are_set() -> None:
    subject = Subject("torchrl")
    refused(subject, lambda: subject.env.set_seed(2**63))
    subject.env.set_seed(2**40)
    with pytest.raises(ValueError, match="options must be a dictionary"):
        subject.reset(options=5)
    subject.reset()
    assert subject.batch.seed == 2**40, "a refused reset does not use a seed up"


def test_snapshots() -> None:
    subject = Subject("batch")
    batch = subject.env
    for call in (batch.save, batch.observe, lambda: batch.copies(1)):
        assert "before reset: call reset() first" in refused(subject, call, ResetNeeded)
    batch.reset()
    others: tuple[Any, ...] = (None, 5, LONG_NAME, {}, batch.state)
    for bad in others:
        assert "what save() returned" in refused(subject, lambda bad=bad: batch.restore(bad))
    for count in (0, 2**63, 10**5000, 1.0, None):
        refused(subject, lambda count=count: batch.copies(count))
    for into in (5, LONG_NAME, batch):
        refused(subject, lambda into=into: batch.copies(1, into=into))


def test_a_mask_that_chooses_no_world_starts_none() -> None:
    for scenario in ("constant", "obstacles"):
        batch = posse.batch(scenario, 2, seed=1)
        batch.reset()
        before = {name: array.copy() for name, array in batch.state.items()}
        nobody = np.zeros(2, np.bool_)
        batch.reset(options={"reset_mask": nobody, "target_pose": [0.0, 0.0, 0.0]})
        for name, array in batch.state.items():
            assert np.array_equal(array, before[name], equal_nan=array.dtype.kind == "f"), name


def test_an_agent_whose_episode_is_over_acts_no_more() -> None:
    subject = Subject("turns")
    subject.reset(seed=1)
    env, rng = subject.env, np.random.default_rng(1)
    while not env.truncations[env.agent_selection]:
        env.step(subject.good_action(rng))
    for action in (np.zeros(2, np.float32), 0, LONG_NAME):
        message = refused(subject, lambda action=action: env.step(action))
        assert message.startswith(f"action of {env.agent_selection} must be None")
    while env.agents:
        env.step(None)
    refused(subject, lambda: env.step(None), ResetNeeded)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"num_trackers": 10**5000}, r"num_trackers=<int that is too long"),
        ({"num_worlds": 10**5000}, r"num_worlds=<int .* below 2\*\*63"),
        ({"num_worlds": 2**50}, r"num_worlds=1125899906842624 of \d+ bytes each .*: lower it"),
        ({"num_threads": 10**5000}, r"num_threads=<int .* below 2\*\*63"),
        ({"first_world": 2**63}, r"first_world=9223372036854775808 must .* below 2\*\*63"),
        ({"first_world": 2**63 - 1}, r"first_world=.* num_worlds=2 go beyond .*: lower first_world"),
        ({"seed": 10**5000}, r"seed=<int .*\[0, 2\*\*63\)"),
        ({"split": np.zeros(2)}, r"unknown split array.*splits are: train"),
        ({"autoreset": LONG_NAME}, r"unknown autoreset mode 'xxx.*\(5,002 characters\)"),
        ({"scenario": LONG_NAME}, r"unknown scenario 'xxx.*\(5,002 characters\)"),
        ({"scenario": "a\0b"}, r"unknown scenario 'a\\x00b'"),
        ({"scenario": ["constant"]}, r"unknown scenario \['constant'\]"),
        ({LONG_NAME: 1}, r"unknown setting 'xxx.*\(5,002 characters\)"),
        ({"formation": LONG_NAME}, r"unknown formation='xxx.*\(5,002 characters\).*known: "),
        ({"target_speed": 10**5000}, r"target_speed=<int .* must be a number"),
        ({"reward_weights": {LONG_NAME: 1}}, r"unknown reward term 'xxx.*\(5,002 characters\)"),
    ],
)
def test_impossible_batches(settings: dict[str, Any], message: str) -> None:
    arguments: dict[str, Any] = {"num_worlds": 2, **settings}
    with pytest.raises(posse.ScenarioError if "device" not in settings else ValueError) as caught:
        posse.batch(**arguments)
    assert caught.match(message)
    assert len(str(caught.value)) <= LONGEST_MESSAGE


def test_worlds_up_to_the_last_one_there_is() -> None:
    batch = posse.batch("constant", 2, first_world=2**63 - 2)
    batch.reset()
    assert batch.state["world_index"].tolist() == [2**63 - 2, 2**63 - 1]
