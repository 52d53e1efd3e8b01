"""Checkpoints are read back unchanged, and a run goes on from a copy of its folder."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest
import torch
from tests.support.runs import assert_equal, numbers, quiet, small

from posse_training.train.checkpoint import read_checkpoint, write_checkpoint
from posse_training.train.train import resume, train


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    train(small(folder, steps=320), console=quiet())
    return folder


def test_what_is_read_is_what_was_written(tmp_path: Path) -> None:
    state: dict[str, Any] = {"a": {"b": torch.arange(3.0), "c": torch.tensor([True])}, "x": [1, None, {"y": 2**127}]}
    write_checkpoint(tmp_path, state)
    again = read_checkpoint(tmp_path)
    assert again["x"] == state["x"]
    assert all(torch.equal(again["a"][name], tensor) for name, tensor in state["a"].items())


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
