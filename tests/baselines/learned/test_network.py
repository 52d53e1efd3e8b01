"""Networks whose parts do not fit are refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from tests.support.learned import network_for

import posse
from posse_baselines import PolicyError
from posse_baselines.learned import Encoding, LearnedPolicy


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"biases": (np.zeros(24, np.float32),)}, "as many biases"),
        ({"scale": np.ones(3, np.float32)}, "statistics"),
        ({"limit": 0.0}, "limit"),
        ({"activation": "gelu"}, "gelu"),
        ({"output": "sigmoid"}, "sigmoid"),
        ({"mean": np.full(10, np.nan, np.float32)}, "finite"),
    ],
)
def test_parts_that_do_not_fit(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(PolicyError, match=message):
        network_for(10, **changes).check()


def test_an_encoding_of_another_length() -> None:
    encoding = Encoding.of(posse.ObservationLayout(posse.get_scenario("smart")))
    with pytest.raises(PolicyError, match="its encoding gives"):
        LearnedPolicy(network_for(10), encoding, {})
