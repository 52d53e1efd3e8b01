"""A learned policy executes its network's output, independent of other worlds in the batch."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from tests.support.learned import observations_of, policy_for

from posse.numeric import FloatArray
from posse_baselines.learned import Encoder, Network


def in_double_precision(network: Network, rows: FloatArray) -> npt.NDArray[np.float64]:
    """The actions for encoded observations, by matrix products."""
    x = np.clip((rows - network.mean) * network.scale, -network.limit, network.limit).astype(np.float64)
    for layer, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True), 1):
        x = x @ weight.T.astype(np.float64) + bias
        if layer < len(network.weights):
            x = np.tanh(x) if network.activation == "tanh" else np.maximum(x, 0)
    return np.asarray(np.tanh(x) if network.output == "tanh" else np.clip(x, -1, 1))


@pytest.mark.parametrize("kind", ["plain", "slots"])
@pytest.mark.parametrize("activation", ["tanh", "relu"])
@pytest.mark.parametrize("output", ["clip", "tanh"])
def test_actions_are_the_networks_output(kind: str, activation: str, output: str) -> None:
    batch, observations = observations_of("field")
    policy = policy_for(batch.layout, kind, activation=activation, output=output)
    actions, _ = policy.act(observations, policy.begin(batch.layout, 6))
    rows = Encoder(policy.encoding, batch.layout).encode(observations)
    expected = in_double_precision(policy.network, rows).reshape(actions.shape)
    np.testing.assert_allclose(actions, expected, rtol=1e-4, atol=1e-4)
    assert np.abs(actions).max() <= 1
    assert np.ptp(actions) > 0.5  # the networks say something
