"""Transitions of the tasks, and what is said in a message."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from tests.support.minds import Mind
from tests.support.plain import plain

tasks, messages = plain("ddcs.tracking.tasks"), plain("ddcs.messages")
NAMES = ("searching", "converging", "flocking", "exchange")
SEARCHING, CONVERGING, FLOCKING, EXCHANGING = range(4)


@pytest.mark.parametrize("pursues", [0, 1])
@pytest.mark.parametrize("task", range(4))
def test_the_next_task_is_that_of_section_3_1(task: int, pursues: int) -> None:
    m = Mind(played={"near": 0.5, "far": 0.9, "range_near": 0.2, "range_far": 0.6})
    near, far = (0.2, 0.6) if pursues else (0.5, 0.9)
    m.d.pursues = pursues
    for known, exchanges, confirmed in itertools.product((0, 1), (0, 1, 2), (0, 1)):
        m.d.known, m.d.exchanges, m.d.confirmed = known, exchanges, confirmed
        for error in (-1.0, 0.0, 0.1, 0.3, 0.5, 0.55, 0.7, 0.95, 3.0):
            m.d.task, m.d.error = task, error
            if not known:
                wanted = SEARCHING
            elif exchanges and not confirmed and task != SEARCHING:
                wanted = EXCHANGING
            elif error < 0.0 or error > (far if task == FLOCKING else near):
                wanted = CONVERGING
            else:
                wanted = FLOCKING
            assert tasks.next_task(m.s, m.d) == wanted


def test_one_forbidden_change_forbids_that_one_alone() -> None:
    for before, after in itertools.permutations(range(4), 2):
        if (before, after) == (SEARCHING, EXCHANGING):
            continue
        m = Mind(played={"forbidden": (f"{NAMES[before]}>{NAMES[after]}",)})
        for pair in itertools.product(range(4), repeat=2):
            assert tasks.may_change(m.s, *pair) == (pair != (before, after))
        m.d.task, m.d.known = before, 0
        assert tasks.next_task(m.s, m.d) == (before if after == SEARCHING else SEARCHING)


def test_a_message_says_task_leader_term_pulse_and_slot() -> None:
    m = Mind()
    said = {"task": 2, "leader": -1, "term": 255, "pulse": 17, "slot": 4}
    for name, value in said.items():
        setattr(m.d, name, value)
    action = np.zeros(7, np.float32)
    messages.write_message(m.d, action)
    assert [messages.decode(float(word)) for word in action[2:]] == [*said.values()]
    np.testing.assert_array_equal(action, np.array([0, 0, *((v + 1) / 512 for v in said.values())], np.float32))


def test_a_count_is_newer_by_the_shorter_way() -> None:
    for value, old in itertools.product(range(256), (0, 1, 100, 255)):
        assert messages.is_newer(value, old) == (0 < (value - old) % 256 < 128)
