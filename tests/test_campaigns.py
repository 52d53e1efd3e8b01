"""The short forms of campaigns; ``make fuzz MINUTES=30`` runs the long ones."""

from __future__ import annotations

from typing import Any

import pytest
from tests.fuzz import calls, processes, worlds
from tests.fuzz.campaign import campaign


@pytest.mark.parametrize(
    ("case", "cases"),
    [(worlds.case, 40), (calls.case, 4), (processes.case, 24)],
    ids=["worlds", "calls", "processes"],
)
def test_no_case_fails(case: Any, cases: int) -> None:
    tries, failures = campaign(case, seed=0, cases=cases)
    assert failures == []
    assert tries == cases


def test_a_failure_is_told_with_the_case_that_plays_it_again() -> None:
    def even(seed: int, number: int) -> None:
        assert number % 2 == 0, f"odd {seed}"

    tries, failures = campaign(even, seed=7, first=1, cases=3)
    assert tries == 3
    assert len(failures) == 2
    assert failures[0].startswith("seed 7, case 1:\n")
    assert "odd 7" in failures[0]
