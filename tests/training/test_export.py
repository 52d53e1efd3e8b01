"""A network as ONNX computes what posse's own forward pass does, in the virtual environment that has onnxruntime."""

import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest
from tests.support.learned import policy_for
from tests.support.process import run_tests_elsewhere

import posse
from posse_baselines.learned import LearnedPolicy
from posse_baselines.learned.network import forward
from posse_baselines.registry import SHIPPED_TARGETS, shipped
from posse_training.commands.export import export

HERE = importlib.util.find_spec("onnxruntime") is not None
needs_onnx = pytest.mark.skipif(not HERE, reason="run elsewhere, by the test that says so")
SHIPPED = shipped() | shipped(SHIPPED_TARGETS)
MINE = policy_for(posse.batch().layout, outputs=4, activation="relu", output="tanh")  # as none that ships


@pytest.mark.long
@pytest.mark.skipif(HERE, reason="they run here")
def test_exports_are_tested_where_onnx_is_installed(tmp_path: Path) -> None:
    assert ", 1 skipped" in run_tests_elsewhere(__file__, tmp_path)


@needs_onnx
@pytest.mark.parametrize("name", [*SHIPPED, "mine"])
def test_an_export_computes_what_the_network_does(name: str, tmp_path: Path) -> None:
    import onnxruntime

    policy = LearnedPolicy.from_file(SHIPPED[name]) if name in SHIPPED else MINE
    network = policy.network
    export(policy, tmp_path / "network.onnx")
    session = onnxruntime.InferenceSession(tmp_path / "network.onnx")
    told = session.get_modelmeta().custom_metadata_map
    named = json.loads(told["columns"])
    json.loads(told["policy"], parse_constant=pytest.fail)  # Infinity is no JSON
    *inputs, output = named
    assert [each.name for each in session.get_outputs()] == [output]
    drawn = np.random.default_rng(0).normal(0, 3, (200, network.inputs))
    rows = (network.mean + drawn / np.where(network.scale, network.scale, 1)).astype(np.float32)
    parts = np.split(rows, np.cumsum([len(named[name]) for name in inputs])[:-1], axis=1)
    (found,) = session.run([output], dict(zip(inputs, parts, strict=True)))
    ours = forward(network.layers(), rows)
    assert ours.std() > 0.01  # it says something
    np.testing.assert_allclose(found, ours, rtol=0, atol=1e-5)
