"""Names of the policies, and shapes of what they return."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.minds import Mind
from tests.support.plain import plain

policy = plain("ddcs.policy")
settings = plain("ddcs.settings")


@pytest.mark.parametrize("model", ["distributed", "centralized"])
def test_a_policy_is_named_by_its_model_unless_it_has_a_name(model: str) -> None:
    assert policy.DDCS(settings.Settings(model=model)).name == f"ddcs-{model}"
    assert policy.DDCS(settings.Settings(model=model), "mine").name == "mine"
    assert policy.DDCS().name == "ddcs-distributed"


def test_a_tracker_has_two_wanted_speeds_and_an_estimate_of_three_numbers() -> None:
    m = Mind("field")
    memory = m.policy.begin(m.layout, 1)
    proposals, memory = m.policy.propose(np.tile(m.o, (1, 5, 1)), memory)
    assert proposals.shape == (1, 5, 2)
    assert m.policy.annotations(memory)["estimate"].shape == (1, 5, 3)
