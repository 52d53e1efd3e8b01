"""Encoding and decoding are inverse, and invalid files raise errors."""

from __future__ import annotations

from typing import Any

import hypothesis.extra.numpy as arrays
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from posse_training.replay import Column, Event, Player, Replay
from posse_training.replay.format import decode, encode

VALUES = arrays.arrays(
    np.float64,
    st.tuples(st.integers(1, 12), st.integers(0, 4)),
    elements=st.one_of(st.floats(-1000, 1000), st.just(float("nan"))),
)


@settings(deadline=None)
@given(values=VALUES, resolution=st.sampled_from([1.0, 0.25, 0.001, 1 / 512]))
def test_any_column_comes_back_to_half_its_resolution(values: Any, resolution: float) -> None:
    replay = Replay({"a": 1}, (Player("p", {"c": Column(values, resolution, "m")}),))
    column = decode(*encode(replay)).players[0].columns["c"]
    assert column.values.shape == values.shape
    assert (column.resolution, column.unit) == (resolution, "m")
    np.testing.assert_array_equal(np.isnan(column.values), np.isnan(values))
    off = np.abs(column.values - values)
    assert np.nanmax(off, initial=0) <= resolution * 0.5 * (1 + 1e-9)


def test_all_that_is_not_a_column_comes_back() -> None:
    world = {"inf": float("inf"), "list": [1, -float("inf"), None, True, "ü"], "in": {"a": 0.1}}
    events = (Event(3, "contact", "text", (1, 2)), Event(9, "dart", ""))
    metrics = {"score": 0.25, "settling_time": float("nan")}
    player = Player("näme", {"c": Column(np.zeros((2, 1)))}, events, metrics, {"card": "x"})
    back = decode(*encode(Replay(world, (player,))))
    assert back.world == world
    assert back.players[0].events == events
    assert back.players[0].about == {"card": "x"}
    assert back.players[0].metrics["score"] == 0.25
    assert np.isnan(back.players[0].metrics["settling_time"])
