"""Searching: the middle of what is not covered is found sooner than its nearest edge."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

import posse
from posse_baselines import DDCS, play


def detection(scenario: str, arena: Any = 20.0, **settings: Any) -> npt.NDArray[np.float64]:
    batch = posse.batch(scenario, 80, seed=4, split="train", message_size=5, horizon=300, arena=arena)
    times = play(batch, DDCS.of("ddcs-distributed").with_settings(**settings))["detection_time"]
    return np.where(np.isnan(times), 30.0, times)


def test_a_rectangle_is_searched_as_fast_as_a_square_of_its_area() -> None:
    square, rectangle = (detection("search", arena) for arena in (20.0, (28.0, 14.0)))
    assert rectangle.max() < 30.0, "found in every world"
    assert rectangle.mean() < square.mean() + 1.0
