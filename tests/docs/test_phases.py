"""What benchmarks/phases.py counts."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from benchmarks import phases

from posse_baselines import load


def found(policy: str, **settings: object) -> npt.NDArray[np.float64]:
    return phases.shares(load(policy), phases.Settings(worlds=4, **settings))  # type: ignore[arg-type]


def test_each_tracker_counts_once() -> None:
    shares = found("ddcs-tuned")
    assert np.allclose(shares.sum(axis=0), 1.0)
    held, unknown, far, near = shares
    assert unknown[0] > unknown[-1] + 0.2  # most find it
    assert held[-1] > 0.5
    assert held[0] < far[0]
    assert near.max() < 0.5


def test_a_team_that_waits_holds_no_slot() -> None:
    held, unknown, far, _ = found("idle")
    assert held.max() < 0.1
    assert not unknown.any()  # it does not say what it knows
    assert far.min() > 0.5


def test_where_all_is_seen_nothing_is_unknown() -> None:
    assert not found("ddcs-tuned", scenario="obstacles")[1].any()
