"""Calls in any order, with arguments of any type, to every kind of environment.

Run it for as long as you like::

    python -m tests.fuzz.calls --minutes 30 --seed 1

A refused call raises a documented error and leaves everything that can be reached from the
environment as it was, compared field by field; a twin that never got the refused calls goes through
the same worlds.
"""

from __future__ import annotations

import random
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from hypothesis import HealthCheck, settings
from hypothesis import seed as seeded
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule, run_state_machine_as_test
from tests.fuzz.campaign import main
from tests.support.attack import BAD_OPTIONS, BAD_SEEDS, MAKERS, Subject, unchanged
from tests.support.everything import everything

SEEDS = st.integers(0, 2**63 - 1)
EXAMPLES = 8
"""Sequences a case; the first that hypothesis plays is the simplest there is."""


class Calls(RuleBasedStateMachine):
    """An environment and its twin, which gets none of the calls that are refused."""

    kinds = tuple(MAKERS)

    @initialize(data=st.data(), first=SEEDS)
    def make(self, data: Any, first: int) -> None:
        kind = data.draw(st.sampled_from(self.kinds))
        self.one, self.twin = Subject(kind), Subject(kind)
        self.first, self.started = first, False

    def refused(self, call: Any) -> None:
        before = self.one.held(), everything(self.one)
        try:
            call()
        except (ValueError, ResetNeeded) as error:
            message = str(error)
        else:
            raise AssertionError("not refused")
        assert 0 < len(message) <= 1000, message[:2000]
        assert unchanged(before, (self.one.held(), everything(self.one)))

    @rule(seed=st.none() | SEEDS)
    def reset(self, seed: int | None) -> None:
        if not self.started:
            seed = self.first  # without one, a first reset draws its own
        self.started = True
        for subject in (self.one, self.twin):
            subject.reset(seed=seed)
        assert unchanged(self.one.held(), self.twin.held())

    # Numbers stand for what hypothesis could not print: whole numbers of 5,000 digits.

    @rule(bad=st.integers(0, len(BAD_SEEDS) - 1))
    def bad_seed(self, bad: int) -> None:
        self.refused(lambda: self.one.reset(seed=BAD_SEEDS[bad]))

    @rule(bad=st.integers(0, len(BAD_OPTIONS) - 1), seed=st.none() | SEEDS)
    def bad_options(self, bad: int, seed: int | None) -> None:
        self.refused(lambda: self.one.reset(seed=seed, options=BAD_OPTIONS[bad]))

    @rule(bad=st.integers(0, 100))
    def bad_action(self, bad: int) -> None:
        actions = [*self.one.bad_actions()]
        action = actions[bad % len(actions)]
        self.refused(lambda: self.one.step(action))

    @rule(draw=st.integers(0, 1000))
    def step(self, draw: int) -> None:
        if not self.started:
            action = None
            if self.one.kind != "turns":
                action = self.one.good_action(np.random.default_rng(draw))
            self.refused(lambda: self.one.step(action))
            return
        for subject in (self.one, self.twin):
            try:
                subject.step(subject.good_action(np.random.default_rng(draw)))
            except ResetNeeded:
                assert self.over(subject)
        assert unchanged(self.one.held(), self.twin.held())

    @staticmethod
    def over(subject: Subject) -> bool:
        return bool(subject.batch.worlds["over"].any())


def case(seed: int, number: int) -> None:
    """Play some sequences of calls."""
    run_state_machine_as_test(
        seeded(random.Random(f"{seed} {number}").randrange(2**32))(type("Calls", (Calls,), {})),
        settings=settings(
            max_examples=EXAMPLES,
            stateful_step_count=30,
            deadline=None,
            database=None,
            suppress_health_check=list(HealthCheck),
        ),
    )


if __name__ == "__main__":
    main(__doc__, case)
