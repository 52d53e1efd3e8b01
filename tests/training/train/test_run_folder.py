"""Errors of a run folder are named, and no data are lost."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from tests.support.runs import quiet, small

from posse_training.errors import CheckpointError, RunFolderError
from posse_training.files import locked
from posse_training.train.train import resume, train


def test_a_damaged_checkpoint(tmp_path: Path) -> None:
    train(small(tmp_path), console=quiet())
    path = tmp_path / "checkpoint.pt"
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(CheckpointError, match=r"checkpoint\.pt is damaged"):
        resume(tmp_path, console=quiet())


def test_a_folder_in_use(tmp_path: Path) -> None:
    code = (
        "import sys, time; from pathlib import Path;"
        "from posse_training.files import locked\n"
        f"with locked(Path({str(tmp_path)!r})): print('held', flush=True); time.sleep(60)"
    )
    holder = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE)
    try:
        assert holder.stdout is not None
        assert holder.stdout.readline() == b"held\n"
        with pytest.raises(RunFolderError, match=f"in use by process {holder.pid}"):
            train(small(tmp_path), console=quiet())
        assert not (tmp_path / "settings.json").exists()
    finally:
        holder.kill()
        holder.wait()
        if holder.stdout is not None:
            holder.stdout.close()
    with locked(tmp_path):  # the lock ended with its holder
        pass


def test_a_folder_that_holds_a_run(tmp_path: Path) -> None:
    train(small(tmp_path), console=quiet())
    before = (tmp_path / "checkpoint.pt").read_bytes()
    with pytest.raises(RunFolderError, match="--resume"):
        train(small(tmp_path), console=quiet())
    assert (tmp_path / "checkpoint.pt").read_bytes() == before


def test_a_checkpoint_of_other_settings(tmp_path: Path) -> None:
    train(small(tmp_path), console=quiet())
    settings = json.loads((tmp_path / "settings.json").read_text())
    settings["hidden"] = [8, 8]
    (tmp_path / "settings.json").write_text(json.dumps(settings))
    with pytest.raises(CheckpointError, match="does not fit"):
        resume(tmp_path, console=quiet())


def test_a_subfolder_that_leads_elsewhere(tmp_path: Path) -> None:
    """As in the folder of a league or a job, whose results lie in subfolders."""
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (tmp_path / "league").mkdir()
    (tmp_path / "league" / "cells").symlink_to(elsewhere)
    with pytest.raises(OSError, match="symbolic link"), locked(tmp_path / "league"):
        pass
    assert list(elsewhere.iterdir()) == []
