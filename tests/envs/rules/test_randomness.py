"""The random draws: values, distribution, and independence of uses."""

from __future__ import annotations

import itertools

import numpy as np

from posse.rules import randomness


def test_the_mixing_function_is_splitmix64s() -> None:
    # The first outputs of SplitMix64 from seed 1234567, as published with it: mix(key, 0) is the
    # finalizer of key + golden ratio.
    golden, state, outputs = 0x9E3779B97F4A7C15, 1234567, []
    for _ in range(3):
        outputs.append(int(randomness.mix(np.uint64(state), np.uint64(0))))
        state = (state + golden) % 2**64
    assert outputs == [6457827717110365317, 3203168211198807973, 9817491932198370423]


def test_seed_split_world_and_episode_each_make_another_key() -> None:
    keys = {
        int(randomness.episode_key(*at))
        for at in itertools.product((0, 1, 2, 3, 2**62), range(3), range(20), range(20))
    }
    assert len(keys) == 5 * 3 * 20 * 20
