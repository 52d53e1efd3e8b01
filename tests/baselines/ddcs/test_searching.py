"""Searching: the middle of what is not covered is found sooner than its nearest edge."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

import posse
from posse_baselines import play, with_settings


def detection(scenario: str, **settings: Any) -> npt.NDArray[np.float64]:
    batch = posse.batch(scenario, 200, seed=4, split="train", message_size=5, horizon=300)
    times = play(batch, with_settings("ddcs-distributed", **settings))["detection_time"]
    return np.where(np.isnan(times), 30.0, times)


def test_swaths_find_the_target_sooner() -> None:
    usual = detection("search")
    assert detection("search", swath=0.5).mean() < usual.mean() - 0.5
