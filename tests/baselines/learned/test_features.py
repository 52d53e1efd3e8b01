"""Features agree with the state of the world."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.support.learned import observations_of

import posse
from posse_baselines.learned import Encoder, Encoding
from posse_baselines.learned.features import NUM_FEATURES, match_slots


def test_own_slot_is_where_the_state_says() -> None:
    batch, observations = observations_of("constant", worlds=8, steps=30)
    rows = Encoder(Encoding.of(batch.layout, "slots"), batch.layout).encode(observations)
    features = rows[:, :NUM_FEATURES].reshape(8, 5, NUM_FEATURES)
    w, t = batch.worlds[:, None], batch.arrays.tracker
    slots = np.array(batch.scenario.slot_offsets)
    x = w["x"] + slots[:, 0] * w["frame_cos"] - slots[:, 1] * w["frame_sin"]
    y = w["y"] + slots[:, 0] * w["frame_sin"] + slots[:, 1] * w["frame_cos"]
    dx, dy = x[:, None] - t["x"][..., None], y[:, None] - t["y"][..., None]
    hc, hs = t["heading_cos"][..., None], t["heading_sin"][..., None]
    ahead, left = dx * hc + dy * hs, dy * hc - dx * hs
    soft = features[:, :, 14 + 2 : 14 + 4]
    length = np.hypot(soft[..., 0], soft[..., 1])
    d = 3.0 * length / (1 - length)
    mine = soft / length[..., None] * d[..., None]
    away = np.hypot(ahead - mine[..., :1], left - mine[..., 1:])
    chosen = away.argmin(axis=2)
    np.testing.assert_allclose(away.min(axis=2), 0, atol=0.02)
    # With a perfect radio all compute the same assignment, so each slot is assigned once.
    assert all(len(set(row)) == 5 for row in chosen)


def test_nothing_known_of_the_target_is_zeros() -> None:
    batch = posse.batch("search", 4)
    observations = batch.reset()
    unknown = batch.layout.views(observations)["target_known"].reshape(-1) == 0
    assert unknown.any()
    rows = Encoder(Encoding.of(batch.layout, "slots"), batch.layout).encode(observations)
    assert not rows[unknown, 14:NUM_FEATURES].any()
    assert np.isfinite(rows).all()


@settings(derandomize=True, deadline=None, max_examples=100)
@given(robots=st.integers(1, 9), slots=st.integers(1, 12), seed=st.integers(0, 2**31))
def test_no_swap_shortens_an_assignment(robots: int, slots: int, seed: int) -> None:
    ways = np.random.default_rng(seed).uniform(0, 10, (robots, slots)).astype(np.float32)
    chosen = np.empty(robots, np.float32)
    match_slots(robots, slots, ways.T, chosen)
    given_out = [int(s) for s in chosen if s >= 0]
    assert len(given_out) == len(set(given_out)) == min(robots, slots)
    if robots <= slots:
        total = ways[np.arange(robots), chosen.astype(int)].sum()
        for i in range(robots):
            for j in range(i):
                other = chosen.astype(int)
                other[[i, j]] = other[[j, i]]
                assert ways[np.arange(robots), other].sum() >= total - 1e-3
