"""The oracle: near the attainable bound, and never without being shown the worlds."""

from __future__ import annotations

import pytest

import posse
from posse_baselines import PolicyError, begin, load, play


def test_it_reaches_nine_tenths_of_the_bound_on_constant() -> None:
    metrics = play(posse.batch("constant", 100, split="train"), load("oracle"))
    assert metrics["score"].mean() >= 0.9 * metrics["bound"].mean()


def test_it_has_to_be_shown_the_batch() -> None:
    batch = posse.batch("constant", 2)
    with pytest.raises(PolicyError, match="show it the batch"):
        load("oracle").begin(batch.layout, 2)


def test_it_refuses_a_batch_other_than_the_one_it_watches() -> None:
    oracle = load("oracle")
    begin(oracle, posse.batch("constant", 2))
    with pytest.raises(PolicyError, match="watches 2 worlds of 'constant', not 3 of 'smart'"):
        oracle.begin(posse.batch("smart", 3, num_trackers=3).layout, 3)
