"""A learned policy executes its network's output, independent of other worlds in the batch."""

from __future__ import annotations

import numpy as np
import pytest
from tests.support.learned import observations_of, policy_for

from posse_baselines.learned import Encoder


@pytest.mark.parametrize("kind", ["plain", "slots"])
@pytest.mark.parametrize("activation", ["tanh", "relu"])
@pytest.mark.parametrize("output", ["clip", "tanh"])
def test_compiled_and_plain_agree(kind: str, activation: str, output: str) -> None:
    batch, observations = observations_of("field")
    policy = policy_for(batch.layout, kind, activation=activation, output=output)
    actions, _ = policy.act(observations, policy.begin(batch.layout, 6))
    rows = Encoder(policy.encoding, batch.layout).encode(observations)
    expected = policy.network.forward(rows).reshape(actions.shape)
    np.testing.assert_allclose(actions, expected, rtol=1e-4, atol=1e-4)
    assert np.abs(actions).max() <= 1
    assert np.ptp(actions) > 0.5  # the networks say something


def test_a_world_plays_alike_alone_and_in_a_batch() -> None:
    batch, observations = observations_of("smart", worlds=600)
    policy = policy_for(batch.layout)
    together, _ = policy.act(observations, policy.begin(batch.layout, 600))
    alone, _ = policy.act(observations[433:434], policy.begin(batch.layout, 1))
    np.testing.assert_array_equal(together[433], alone[0])


def test_returned_actions_are_never_overwritten() -> None:
    batch, observations = observations_of("smart")
    policy = policy_for(batch.layout)
    memory = policy.begin(batch.layout, 6)
    first, memory = policy.act(observations, memory)
    kept = first.copy()
    policy.act(observations + np.float32(0.1), memory)
    np.testing.assert_array_equal(first, kept)
