"""Forged checkpoints with a correct digest and invalid contents raise named errors."""

from __future__ import annotations

import contextlib
import copy
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.support.runs import assert_equal, numbers, quiet, small

from posse_training.errors import CheckpointError
from posse_training.runs.saved.checkpoint import read_checkpoint, write_checkpoint
from posse_training.runs.train import resume, train


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    train(small(folder, steps=320), console=quiet())
    return folder


def test_what_is_read_is_what_was_written(tmp_path: Path) -> None:
    arrays = {"a": np.arange(3.0), "b/c": np.array([True])}
    write_checkpoint(tmp_path, arrays, {"x": [1, None, {"y": "z"}]})
    again, state = read_checkpoint(tmp_path)
    assert state == {"x": [1, None, {"y": "z"}]}
    assert set(again) == set(arrays)
    assert all(again[name].tobytes() == array.tobytes() for name, array in arrays.items())


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Every path in nested dictionaries and lists."""
    items: Any = ()
    if isinstance(value, dict):
        items = value.items()
    elif isinstance(value, list):
        items = enumerate(value[:3])
    return [path, *(place for key, item in items for place in places(item, (*path, key)))]


@settings(derandomize=True, deadline=None, max_examples=60)
@given(data=st.data())
def test_a_forged_state_is_refused_or_taken(run: Path, data: st.DataObject) -> None:
    """Any value at one path of the state: a named error, or a run that can be resumed."""
    before = (run / "checkpoint.safetensors").read_bytes()
    arrays, state = read_checkpoint(run)
    place = data.draw(st.sampled_from(places(state)[1:]))
    forged = copy.deepcopy(state)
    inner = forged
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = data.draw(st.sampled_from([None, "x", [], {}, -1, 1.5, [[]], True]))
    try:
        write_checkpoint(run, arrays, forged)
        with contextlib.suppress(CheckpointError):
            resume(run, console=quiet(), steps=320)
    finally:
        (run / "checkpoint.safetensors").write_bytes(before)


@pytest.mark.parametrize("change", ["missing", "shape"])
def test_forged_arrays(run: Path, tmp_path: Path, change: str) -> None:
    arrays, state = read_checkpoint(run)
    (tmp_path / "settings.json").write_bytes((run / "settings.json").read_bytes())
    for name in list(arrays)[::2]:
        forged = dict(arrays)
        if change == "missing":
            del forged[name]
        else:
            forged[name] = np.zeros((2, 3, 5, 7), np.float32)
        write_checkpoint(tmp_path, forged, state)
        with pytest.raises(CheckpointError, match="does not fit its settings"):
            resume(tmp_path, console=quiet())


@pytest.mark.parametrize("change", ["return", "nan", "over"])
def test_forged_episodes(run: Path, tmp_path: Path, change: str) -> None:
    """What would fail in a later step or log is found before the run goes on."""
    arrays, state = read_checkpoint(run)
    (tmp_path / "settings.json").write_bytes((run / "settings.json").read_bytes())
    if change == "over":
        arrays["worlds/0.world_over"] = np.ones_like(arrays["worlds/0.world_over"])
    else:
        number = 10**400 if change == "return" else float("nan")
        state["model"]["episodes"] = [{"r": number, "l": 40, "score": 0.5}]
    write_checkpoint(tmp_path, arrays, state)
    with pytest.raises(CheckpointError, match="does not fit its settings"):
        resume(tmp_path, console=quiet(), steps=640)


def optimiser_of(state: dict[str, Any]) -> dict[str, Any]:
    """The optimiser's part of a state, as dictionaries."""
    parts = dict(state["model"]["parts"]["items"])
    return dict(parts["policy.optimizer"]["items"])


@pytest.mark.parametrize("change", ["eps", "no eps", "no moment", "nan moment", "nan weight"])
def test_forged_optimisers_and_weights(run: Path, tmp_path: Path, change: str) -> None:
    """What torch would only find wrong in mid-training is found before it."""
    arrays, state = read_checkpoint(run)
    (tmp_path / "settings.json").write_bytes((run / "settings.json").read_bytes())
    optimiser = optimiser_of(state)
    group = optimiser["param_groups"]["list"][0]["items"]
    moments = optimiser["state"]["items"][0][1]["items"]
    place = next(k for k, (name, _) in enumerate(group) if name == "eps")
    if change == "eps":
        group[place][1] = {"value": "x"}
    elif change == "no eps":
        del group[place]
    elif change == "no moment":
        del moments[-1]
    else:
        weights = dict(dict(state["model"]["parts"]["items"])["policy"]["items"])
        name = moments[-1][1]["tensor"] if change == "nan moment" else (next(iter(weights.values()))["tensor"])
        arrays[f"model/{name}"] = np.full_like(arrays[f"model/{name}"], np.nan)
    write_checkpoint(tmp_path, arrays, state)
    with pytest.raises(CheckpointError, match="does not fit its settings"):
        resume(tmp_path, console=quiet(), steps=640)


def test_state_nested_too_deeply(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    deep = "[" * 200_000 + "]" * 200_000
    with monkeypatch.context() as patched:
        patched.setattr("posse_training.runs.saved.checkpoint.json.dumps", lambda _: deep)
        write_checkpoint(tmp_path, {"a": np.zeros(1)}, {})
    with pytest.raises(CheckpointError, match="is damaged"):
        read_checkpoint(tmp_path)


def test_a_run_leaves_files_that_are_readable_like_any_others(run: Path, tmp_path: Path) -> None:
    (tmp_path / "plain").touch()
    wanted = (tmp_path / "plain").stat().st_mode & 0o777
    assert (run / "best.safetensors").is_file()
    assert {path.stat().st_mode & 0o777 for path in run.iterdir()} == {wanted}


def test_a_run_can_be_resumed_in_a_copy_of_its_folder(run: Path, tmp_path: Path) -> None:
    shutil.copytree(run, tmp_path / "copy")
    train(small(tmp_path / "whole", steps=320), console=quiet())
    for name in ("copy", "whole"):
        resume(tmp_path / name, console=quiet(), steps=640)
    assert_equal(numbers(tmp_path / "copy"), numbers(tmp_path / "whole"))
