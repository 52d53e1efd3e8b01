"""Calls in any order: what is refused changes nothing; actions of every form are read, and all kinds play one world."""

import copy
import math
import pickle
from typing import Any

import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule, run_state_machine_as_test
from tests.support.attack import BAD_OPTIONS, BAD_SEEDS, MAKERS, Subject, out_of_band, same

from posse import REWARD_TERMS, parallel_env

SEEDS = st.integers(0, 2**63 - 1)


class Calls(RuleBasedStateMachine):
    """An environment, and a twin that gets the valid calls only; both go through the same worlds."""

    kind = ""

    @initialize(first=SEEDS)
    def make(self, first: int) -> None:
        self.one, self.twin = Subject(self.kind), Subject(self.kind)
        self.first, self.started = first, False

    @rule(seed=st.none() | SEEDS)
    def reset(self, seed: int | None) -> None:
        if not self.started:
            seed = self.first  # without one, a first reset draws its own
        self.started = True
        for subject in (self.one, self.twin):
            subject.env.reset(seed=seed)

    # Numbers stand for what hypothesis could not print: whole numbers of 5,000 digits.

    @rule(bad=st.integers(0, len(BAD_SEEDS) - 1))
    def bad_seed(self, bad: int) -> None:
        self.one.refused(lambda: self.one.env.reset(seed=BAD_SEEDS[bad]))

    @rule(bad=st.integers(0, len(BAD_OPTIONS) - 1), seed=st.none() | SEEDS)
    def bad_options(self, bad: int, seed: int | None) -> None:
        self.one.refused(lambda: self.one.env.reset(seed=seed, options=BAD_OPTIONS[bad]))

    @rule(bad=st.integers(0, 100))
    def bad_action(self, bad: int) -> None:
        actions = [*self.one.bad_actions()]
        self.one.refused(lambda: self.one.env.step(actions[bad % len(actions)]))

    @rule(draw=st.integers(0, 1000))
    def step(self, draw: int) -> None:
        if not self.started:
            action = self.one.good_action(np.random.default_rng(draw))
            self.one.refused(lambda: self.one.env.step(action))
            return
        for subject in (self.one, self.twin):
            try:
                subject.env.step(subject.good_action(np.random.default_rng(draw)))
            except ResetNeeded:
                assert subject.batch.arrays.world["over"].any()
        assert same(self.one.held(), self.twin.held())


@pytest.mark.parametrize("kind", MAKERS)
def test_a_refused_call_changes_nothing(kind: str) -> None:
    if kind == "torchrl":
        pytest.importorskip("torchrl", reason="no torchrl: pip install '.[training]'")
    run_state_machine_as_test(
        type("Calls", (Calls,), {"kind": kind}),
        settings=settings(
            max_examples=3 if kind == "torchrl" else 8, stateful_step_count=25, suppress_health_check=list(HealthCheck)
        ),
    )


def played(subject: Subject, steps: int, seed: int = 0) -> list[Any]:
    """Step with drawn actions, and reset where the episode is over; return all that was returned."""
    rng, returned = np.random.default_rng(seed), []
    for _ in range(steps):
        try:
            returned.append(subject.env.step(subject.good_action(rng)))
        except ResetNeeded:
            returned.append(subject.env.reset())
    return returned


one_by_one = pytest.mark.parametrize("kind", [kind for kind in MAKERS if kind != "torchrl"])


@one_by_one
@pytest.mark.parametrize(
    "replica",
    [copy.deepcopy, lambda e: pickle.loads(pickle.dumps(e)), out_of_band],  # noqa: S301
    ids=["deepcopy", "pickle", "out of band"],
)
def test_a_copy_made_in_mid_episode_goes_on_alike(kind: str, replica: Any) -> None:
    one, twin = Subject(kind), Subject(kind)
    one.env.reset(seed=3)
    played(one, 2)
    if kind in ("parallel", "team", "solo"):
        one.env.state()
    twin.env = replica(one.env)
    assert same(played(one, 20), played(twin, 20))
    assert same(one.env.reset(seed=1), twin.env.reset(seed=1))


def test_an_environment_goes_on_from_where_it_was_saved() -> None:
    env = parallel_env("constant", horizon=3)
    env.reset()
    saved, actions = env.batch.save(), {agent: env.action_space(agent).sample() for agent in env.agents}
    while env.agents:
        env.step(actions)
    env.batch.restore(saved)
    assert list(env.step(actions)[0]) == env.agents == env.possible_agents


def test_infos_say_who_works() -> None:
    env = parallel_env("leader-loss", target_motion="agent")
    env.reset()
    env.batch.arrays.tracker["broken_at"][0, 1] = 0
    infos = env.step(dict.fromkeys(env.agents, np.array([0, 0], np.float32)))[-1]
    assert [infos[agent]["working"] for agent in env.possible_agents] == [True, False, True, True, True, True]


@one_by_one
def test_what_is_returned_is_never_overwritten(kind: str) -> None:
    subject = Subject(kind)
    held = [subject.env.reset(seed=0)]
    kept = copy.deepcopy(held)
    for step in range(30):
        returned = played(subject, 1, step)
        if step % 3:  # the others are given up, and their memory may be used again
            held += returned
            kept += copy.deepcopy(returned)
    assert same(held, kept)


VALUES = np.array([[[0.5, -0.25], [1.0, -1.0]], [[0.0, 0.75], [-0.5, 1.0]]], np.float32)


def frozen(array: Any) -> Any:
    array = array.copy()
    array.flags.writeable = False
    return array


FORMS: dict[str, Any] = {
    "read-only": frozen,
    "of a transposed array": np.asfortranarray,
    "float64": lambda array: array.astype(np.float64),
    "big-endian": lambda array: array.astype(">f4"),
    "list": lambda array: array.tolist(),
}


def started(kind: str, **settings: Any) -> Subject:
    subject = Subject(kind, scenario="smart", **settings)
    subject.env.reset(seed=0)
    return subject


@pytest.mark.parametrize("form", FORMS.values(), ids=list(FORMS))
@pytest.mark.parametrize("kind", ["batch", "parallel", "team", "team vector"])
def test_any_form_of_the_same_numbers_is_the_same_action(kind: str, form: Any) -> None:
    one, other = started(kind), started(kind)
    whole = one.action(VALUES)
    given = {name: form(row) for name, row in whole.items()} if kind == "parallel" else form(whole)
    assert same(one.env.step(whole)[:4], other.env.step(given)[:4])


@one_by_one
def test_numbers_outside_are_clipped_where_that_is_asked_for_and_by_rounding(kind: str) -> None:
    bounds = np.sign(VALUES + np.float32(0.1))
    rounded, clipping, reference = started(kind), started(kind, clip_actions=True), started(kind)

    def step(subject: Subject, actions: Any) -> Any:
        return subject.env.step(subject.action(actions))[:4]

    expected = step(reference, bounds)
    assert same(step(rounded, frozen(bounds * np.float32(1 + 1e-6))), expected)
    assert same(step(clipping, frozen(bounds * np.float32(30.0))), expected)
    with pytest.raises(ValueError, match=r"1\.00000\d* is not a number in \[-1, 1\].*clip_actions=True"):
        step(rounded, bounds * np.float32(1 + 1.2e-6))
    for bad in (math.nan, math.inf, -math.inf):
        for subject in (rounded, clipping):
            with pytest.raises(ValueError, match=r"(nan|inf) is not a number in \[-1, 1\]"):
                step(subject, np.where(bounds > 0, bad, np.float32(0.5)))


@pytest.mark.parametrize("kind", ["parallel", "team", "solo"])
def test_worlds_differ_without_a_seed_and_follow_from_one(kind: str) -> None:
    starts = [Subject(kind, **seed).env.reset()[0] for seed in ({}, {}, {"seed": 4})]
    assert not same(starts[0], starts[1])
    subjects = Subject(kind), Subject(kind)
    assert all(same(starts[2], subject.env.reset(seed=4)[0]) for subject in subjects)
    assert len({subject.env.np_random.random() for subject in subjects}) == 1


@pytest.mark.parametrize("kind", ["team", "solo"])
def test_contact_terminates_where_it_is_asked_for(kind: str) -> None:
    subject = Subject(kind, terminate_on_contact=True, num_trackers=1, target_speed=0.0, horizon=40)
    subject.env.reset(options={"tracker_pose": [[-1.0, 0, 0]], "target_pose": [0.0, 0, 0]})
    ends = [subject.env.step(subject.action(np.array([[[1, 0]]], np.float32)))[2:4] for _ in range(7)]
    assert ends == [(False, False)] * 6 + [(True, False)]


def test_an_environment_of_many_agents_is_the_first_world_of_a_batch() -> None:
    """Those of one agent are compared with vector environments."""
    settings: dict[str, Any] = {"split": "test", "first_world": 5, "horizon": 40}
    subject, batch = Subject("parallel", **settings), MAKERS["batch"](**settings)
    seen, rows, rng = subject.env.reset(seed=9)[0], batch.reset(seed=9), np.random.default_rng(0)
    for _ in range(30):
        np.testing.assert_array_equal(list(seen.values()), rows[0])
        drawn = rng.uniform(-1, 1, batch.action_shape).astype(np.float32)
        seen, reward, *_, infos = subject.env.step(subject.action(drawn))
        rows, rewards, *_, told = batch.step(drawn)
        assert list(reward.values()) == rewards[0].tolist()
        for name in ("score", *(f"reward/{term.name}" for term in REWARD_TERMS)):
            assert infos["tracker_0"][name] == told[name][0].flat[0]
