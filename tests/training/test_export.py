"""A network as ONNX computes what posse's own forward pass does, in the virtual environment that has onnxruntime."""

import importlib.util
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.support.learned import network_for, observations_of
from tests.support.process import run_tests_elsewhere

from posse.numeric import FloatArray
from posse_baselines.learned import Encoder, Encoding, LearnedPolicy
from posse_baselines.learned.network import forward
from posse_baselines.registry import SHIPPED_TARGETS, shipped
from posse_baselines.safeguard import Guard
from posse_training.commands.export import export

HERE = importlib.util.find_spec("onnxruntime") is not None
needs_onnx = pytest.mark.skipif(not HERE, reason="run elsewhere, by the test that says so")
SHIPPED = shipped() | shipped(SHIPPED_TARGETS)


@pytest.mark.long
@pytest.mark.skipif(HERE, reason="they run here")
def test_exports_are_tested_where_onnx_is_installed(tmp_path: Path) -> None:
    assert ", 1 skipped" in run_tests_elsewhere(__file__, tmp_path)


def outputs_of(policy: LearnedPolicy, rows: FloatArray, folder: Path) -> Any:
    """What onnxruntime computes from the network's inputs (rows, inputs)."""
    import onnxruntime

    export(policy, folder / "network.onnx")
    session = onnxruntime.InferenceSession(folder / "network.onnx")
    told = session.get_modelmeta().custom_metadata_map
    named = json.loads(told["columns"])
    json.loads(told["policy"], parse_constant=pytest.fail)  # Infinity is no JSON
    *inputs, output = named
    assert [each.name for each in session.get_outputs()] == [output]
    parts = np.split(rows, np.cumsum([len(named[name]) for name in inputs])[:-1], axis=1)
    return session.run([output], dict(zip(inputs, parts, strict=True)))[0]


@needs_onnx
@pytest.mark.parametrize("name", SHIPPED)
def test_what_ships(name: str, tmp_path: Path) -> None:
    policy = LearnedPolicy.from_file(SHIPPED[name])
    network = policy.network
    drawn = np.random.default_rng(0).normal(0, 3, (200, network.inputs))
    rows = (network.mean + drawn / np.where(network.scale, network.scale, 1)).astype(np.float32)
    ours = forward(network.layers(), rows)
    assert ours.std() > 0.01  # it says something
    np.testing.assert_allclose(outputs_of(policy, rows, tmp_path), ours, rtol=0, atol=1e-5)


@needs_onnx
@pytest.mark.parametrize(("activation", "output", "safeguard"), [("tanh", "clip", True), ("relu", "tanh", False)])
def test_the_network_is_the_policy_but_for_the_safeguard(
    activation: str, output: str, safeguard: bool, tmp_path: Path
) -> None:
    batch, observations = observations_of("smart", message_size=2)
    encoding = Encoding.of(batch.layout, "features")
    network = network_for(encoding.size, 4, activation=activation, output=output)
    policy = LearnedPolicy(network, encoding, {}, safeguard=safeguard)
    wanted, _ = policy.act(observations, policy.begin(batch.layout, 6))
    rows = Encoder(encoding, batch.layout, 6).encode(observations)
    actions = outputs_of(policy, rows, tmp_path).reshape(wanted.shape)
    if safeguard:
        actions = Guard(batch.layout, 6).actions(observations, actions)
    np.testing.assert_allclose(actions, wanted, rtol=0, atol=1e-5)
