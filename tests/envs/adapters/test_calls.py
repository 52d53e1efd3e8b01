"""Calls in any order, with valid and invalid arguments: what is refused changes nothing."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule, run_state_machine_as_test
from tests.support.adapters import out_of_band, same
from tests.support.attack import BAD_OPTIONS, BAD_SEEDS, MAKERS, Subject

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
                assert subject.batch.worlds["over"].any()
        assert same(self.one.held(), self.twin.held())


@pytest.mark.parametrize("kind", MAKERS)
def test_a_refused_call_changes_nothing(kind: str) -> None:
    if kind == "torchrl":
        pytest.importorskip("torchrl", reason="no torchrl: pip install '.[training]'")
    run_state_machine_as_test(
        type("Calls", (Calls,), {"kind": kind}),
        settings=settings(
            derandomize=True,
            database=None,
            deadline=None,
            max_examples=3 if kind == "torchrl" else 8,
            stateful_step_count=25,
            suppress_health_check=list(HealthCheck),
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
