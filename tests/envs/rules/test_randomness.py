"""The random draws: values, distribution, and independence of uses."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy import stats
from tests.support.reference import draws as reference

import posse
from posse.rules import randomness


def test_the_mixing_function_is_splitmix64s() -> None:
    # The first outputs of SplitMix64 from seed 1234567, as published with it: mix(key, 0) is the
    # finalizer of key + golden ratio.
    golden, state, outputs = 0x9E3779B97F4A7C15, 1234567, []
    for _ in range(3):
        outputs.append(int(randomness.mix(np.uint64(state), np.uint64(0))))
        state = (state + golden) % 2**64
    assert outputs == [6457827717110365317, 3203168211198807973, 9817491932198370423]


def test_draws_equal_an_independent_working() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        key = int(rng.integers(2**63))
        step, stream, index = (int(k) for k in rng.integers(0, 1000, 3))
        mine = randomness.uniform(np.uint64(key), step, np.uint64(stream), index)
        assert float(mine) == reference.uniform(key, step, stream, index)
        pair = randomness.normal_pair(np.uint64(key), step, np.uint64(stream), index)
        assert pair == pytest.approx(reference.normal_pair(key, step, stream, index), rel=1e-4, abs=1e-4)


def test_uniform_draws_are_uniform_along_every_coordinate() -> None:
    for axis in range(4):
        at = [7, 3, 5, 2]
        draws = []
        for k in range(20_000):
            at[axis] = k
            draws.append(reference.uniform(*at))
        assert stats.kstest(draws, "uniform").pvalue > 1e-3
        lagged = np.corrcoef(draws[:-1], draws[1:])[0, 1]
        assert abs(lagged) < 4 / np.sqrt(len(draws))


def test_normal_draws_are_cut_at_three_and_unbiased() -> None:
    draws = np.array([reference.normal_pair(9, step, 5, 0) for step in range(20_000)])
    assert (np.hypot(*draws.T) <= 3.0 + 1e-9).all()
    assert np.abs(draws.mean(axis=0)).max() < 4 / np.sqrt(len(draws))
    # The variance of a normal plane cut at radius 3: 1 - 4.5 e^-4.5 / (1 - e^-4.5).
    cut = np.exp(-4.5)
    np.testing.assert_allclose(draws.var(axis=0), 1 - 4.5 * cut / (1 - cut), atol=0.04)
    assert abs(np.corrcoef(draws.T)[0, 1]) < 4 / np.sqrt(len(draws))


def test_seed_split_world_and_episode_each_make_another_key() -> None:
    keys = {
        int(randomness.episode_key(*at))
        for at in itertools.product((0, 1, 2, 3, 2**62), range(3), range(20), range(20))
    }
    assert len(keys) == 5 * 3 * 20 * 20


def test_neighbouring_worlds_start_independently() -> None:
    batch = posse.batch(num_worlds=4000)
    batch.reset(seed=0)
    x = batch.state["world_x"].astype(np.float64)
    assert stats.kstest((x + 10) / 20, "uniform").pvalue > 1e-3
    assert abs(np.corrcoef(x[:-1], x[1:])[0, 1]) < 4 / np.sqrt(len(x))
    again = posse.batch(num_worlds=4000)
    again.reset(seed=1)
    assert abs(np.corrcoef(x, again.state["world_x"])[0, 1]) < 4 / np.sqrt(len(x))
