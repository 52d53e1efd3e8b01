"""Files with a correct digest and invalid contents: a named error, and no code runs."""

from __future__ import annotations

import contextlib
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.support.learned import any_policy

import posse
from posse_baselines import PolicyError, play
from posse_baselines.learned import LearnedPolicy
from posse_baselines.learned.policy_file import write_policy_file

POLICY = any_policy()
TENSORS = POLICY.network.tensors()


@pytest.fixture
def described(tmp_path: Path) -> dict[str, Any]:
    """The description in a policy file."""
    from safetensors import safe_open

    POLICY.save(tmp_path / "plain.safetensors")
    with safe_open(tmp_path / "plain.safetensors", framework="numpy") as file:
        found: dict[str, Any] = json.loads(file.metadata()["posse-policy"])
    return found


def forged(folder: Path, description: Any, tensors: dict[str, Any] = TENSORS) -> Path:
    """Write a file of these contents with the digest that belongs to them."""
    path = folder / "forged.safetensors"
    write_policy_file(path, tensors, description)
    return path


def test_what_is_forged_as_it_was_is_read(tmp_path: Path, described: dict[str, Any]) -> None:
    assert LearnedPolicy.from_file(forged(tmp_path, described)).name == "mine"


ENCODING = {"kind": "plain", "neighbours": 0, "fields": []}
FIELD = ["speed", 1, "m/s", 0.0, False]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": 2}, "its format is 2, this version reads 1"),
        ({"format": None}, "its format is None"),
        ({"limit": "wide"}, "damaged"),
        ({"limit": 1e300}, "limit=1e\\+300"),
        ({"limit": float("nan")}, "limit=nan"),
        ({"limit": 10**400}, "damaged"),
        ({"activation": []}, "unknown activation"),
        ({"activation": "x" * 5000}, "unknown activation"),
        ({"output": "x" * 5000}, "unknown activation"),
        ({"format": "x" * 5000}, "its format is"),
        ({"adviser": "x" * 5000}, "its adviser"),
        ({"adviser": "os:system"}, "its adviser 'os:system' is none of"),
        ({"adviser": "planner"}, "cannot be an adviser"),
        ({"adviser": ["pursuit"]}, "damaged"),
        ({"adviser": "ddcs-distributed"}, "the network takes"),
        ({"encoding": None}, "inputs is damaged"),
        ({"encoding": {**ENCODING, "neighbours": 10**9}}, "inputs is damaged"),
        ({"encoding": {**ENCODING, "fields": [FIELD, FIELD[:2]]}}, "inputs is damaged"),
        ({"encoding": {**ENCODING, "fields": [["speed", 10**9, "m/s", 0, False]]}}, "takes"),
        ({"encoding": {**ENCODING, "fields": [["x", 1, "", float("nan"), False]]}}, "damaged"),
        ({"encoding": {**ENCODING, "fields": [["x", float("inf"), "", 0, False]]}}, "damaged"),
        ({"card": []}, "card must be a mapping"),
        ({"card": "name"}, "card must be a mapping"),
        ({"card": {"name": 3}}, "name on its card, 3"),
        ({"card": {"name": ""}}, "printable characters"),
        ({"card": {"name": "x" * 400}}, "1 to 100 printable"),
        ({"card": {"name": "a\0b"}}, "printable"),
        ({"card": {"name": "a\nb"}}, "printable"),
        ({"card": {"trained_splits": "train"}}, "trained_splits='train'"),
        ({"card": {"trained_splits": ["trian"]}}, "trained_splits="),
        ({"card": {"trained_splits": [[]]}}, "trained_splits="),
        ({"card": {"trained_splits": 3}}, "trained_splits=3"),
    ],
)
def test_descriptions_that_make_no_policy(
    tmp_path: Path, described: dict[str, Any], changes: dict[str, Any], message: str
) -> None:
    path = forged(tmp_path, {**described, **changes})
    with pytest.raises(PolicyError, match=message) as caught:
        LearnedPolicy.from_file(path)
    assert str(path) in str(caught.value)
    assert len(str(caught.value)) < 1000


def test_fields_with_long_names_are_named_in_short(tmp_path: Path, described: dict[str, Any]) -> None:
    described["encoding"]["fields"][0][:3:2] = ["x" * 5000, "x" * 5000]
    policy = LearnedPolicy.from_file(forged(tmp_path, described))
    with pytest.raises(PolicyError, match="do not fit") as caught:
        policy.begin(posse.batch("smart", 1).layout, 1)
    assert len(str(caught.value)) < 1000


@pytest.mark.parametrize(
    "missing", ["format", "limit", "activation", "output", "encoding", "card", "adviser", "correction"]
)
def test_descriptions_that_lack_something(tmp_path: Path, described: dict[str, Any], missing: str) -> None:
    del described[missing]
    with pytest.raises(PolicyError, match=f"damaged: KeyError.*{missing}"):
        LearnedPolicy.from_file(forged(tmp_path, described))


@pytest.mark.parametrize("description", [None, 3, "text", [], [[]], {}])
def test_descriptions_of_another_kind(tmp_path: Path, description: Any) -> None:
    with pytest.raises(PolicyError, match="damaged"):
        LearnedPolicy.from_file(forged(tmp_path, description))


def test_json_nested_too_deeply(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patched:
        patched.setattr("posse_baselines.learned.policy_file.json.dumps", lambda *_, **__: DEEP)
        path = forged(tmp_path, None)
    with pytest.raises(PolicyError, match="nested too deeply"):
        LearnedPolicy.from_file(path)


DEEP = "[" * 200_000 + "]" * 200_000


@pytest.mark.parametrize(
    ("name", "array"),
    [
        ("normaliser.mean", np.float32(0)),
        ("normaliser.mean", np.zeros((3, 3), np.float32)),
        ("normaliser.mean", np.full_like(TENSORS["normaliser.mean"], 3e38)),
        ("normaliser.scale", np.zeros(0, np.float32)),
        ("layers.0.weight", np.full_like(TENSORS["layers.0.weight"], 3e38)),
        ("layers.0.weight", TENSORS["layers.0.weight"].astype(np.float64)),
        ("layers.1.weight", np.full_like(TENSORS["layers.1.weight"], np.inf)),
        ("layers.2.bias", np.full_like(TENSORS["layers.2.bias"], np.nan)),
        ("layers.2.weight", TENSORS["layers.2.weight"][:1]),
        ("layers.7.weight", TENSORS["layers.2.weight"]),
    ],
)
def test_arrays_that_make_no_network(tmp_path: Path, described: dict[str, Any], name: str, array: Any) -> None:
    path = forged(tmp_path, described, {**TENSORS, name: np.asarray(array)})
    with pytest.raises(PolicyError, match=r"forged\.safetensors"):
        LearnedPolicy.from_file(path)


@settings(derandomize=True, deadline=None, max_examples=60)
@given(exponents=st.lists(st.floats(0, 38), min_size=4, max_size=4), activation=st.sampled_from(["tanh", "relu"]))
def test_whatever_is_accepted_acts_in_the_box(exponents: list[float], activation: str) -> None:
    """Finite weights that could overflow are refused; all others give finite actions."""
    import tempfile

    description = {
        "format": 1,
        "limit": 5.0,
        "activation": activation,
        "output": "clip",
        "adviser": None,
        "correction": "motion",
        "encoding": POLICY.encoding.to_dict(),
        "card": {},
    }
    scaled = dict(TENSORS)
    for (name, array), exponent in zip(list(TENSORS.items())[1:5], exponents, strict=True):
        with np.errstate(over="ignore"):
            scaled[name] = np.clip(array * np.float32(10**exponent), -3e38, 3e38)
    with tempfile.TemporaryDirectory() as folder, contextlib.suppress(PolicyError):
        policy = LearnedPolicy.from_file(forged(Path(folder), description, scaled))
        batch = posse.batch("smart", 4, horizon=5, settle_time=0.5)
        assert np.isfinite(play(batch, policy)["score"]).all()


def test_weights_that_overflow_are_named(tmp_path: Path, described: dict[str, Any]) -> None:
    large = {**TENSORS, "layers.1.weight": np.full_like(TENSORS["layers.1.weight"], 1e38)}
    with pytest.raises(PolicyError, match=r"layer 1 are so large \(up to 1e\+38\)"):
        LearnedPolicy.from_file(forged(tmp_path, described, large))


@pytest.mark.skipif(os.name != "posix", reason="permissions")
@pytest.mark.parametrize("mask", [0o022, 0o077, 0o002])
def test_files_have_the_permissions_of_any_new_file(tmp_path: Path, mask: int) -> None:
    before = os.umask(mask)
    try:
        POLICY.save(tmp_path / "mine.safetensors")
    finally:
        os.umask(before)
    assert (tmp_path / "mine.safetensors").stat().st_mode & 0o777 == 0o666 & ~mask
