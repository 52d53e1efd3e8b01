"""A resumed run is bit-identical to an uninterrupted one; errors of a run folder are named, and no data are lost."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from numpy.testing import assert_equal
from tests.support.runs import AGAINST, GUARDED, TARGET, killed_at, numbers, quiet, resume, small, steps_saved

from posse_training.errors import RunFolderError
from posse_training.files import locked
from posse_training.train import checkpoint
from posse_training.train.train import Run, train


@pytest.mark.parametrize(
    ("algorithm", "changes"),
    [
        ("ppo", {}),
        *(pytest.param(name, {}, marks=pytest.mark.long) for name in ("mappo", "sac", "td3")),
        ("ppo", GUARDED),
        ("ppo", {"imitate": "pursuit", "imitate_rounds": 2}),
        ("ppo", TARGET),
        ("ppo", AGAINST),
    ],
)
def test_an_interrupted_training_ends_as_an_uninterrupted_one(
    tmp_path: Path, algorithm: str, changes: dict[str, Any]
) -> None:
    train(small(tmp_path / "whole", algorithm, **changes), console=quiet())
    with killed_at(checkpoint, "write_checkpoint", 4):
        train(small(tmp_path / "cut", algorithm, **changes), console=quiet())
    assert 0 < steps_saved(tmp_path / "cut") < steps_saved(tmp_path / "whole")
    if not changes:
        with killed_at(Run, "_checkpoint", 2):  # the last one
            resume(tmp_path / "cut")
        assert not (tmp_path / "cut/last.safetensors").exists(), "a league takes it for the end"
    resume(tmp_path / "cut")
    assert_equal(numbers(tmp_path / "whole"), numbers(tmp_path / "cut"))


SCRIPT = """
import json, pathlib, sys
from posse_training.train import TrainSettings
from posse_training.train.train import train
train(TrainSettings.from_dict({**json.loads(sys.argv[1]), "folder": pathlib.Path(sys.argv[2])}))
"""


@pytest.mark.long
def test_kill_9_loses_nothing_that_was_saved(tmp_path: Path) -> None:
    settings = small(tmp_path / "whole", steps=12_000, evaluate_every=6000, checkpoint_every=800)
    train(settings, console=quiet())
    folder = tmp_path / "killed"
    command = [sys.executable, "-c", SCRIPT, json.dumps(settings.to_dict()), str(folder)]
    for target in (800, 4000):
        running, reached = subprocess.Popen(command), 0
        while reached < target:
            assert running.poll() is None
            time.sleep(0.01)
            reached = steps_saved(folder) if (folder / "checkpoint.pt").exists() else 0
        running.kill()
        running.wait()
        assert reached <= steps_saved(folder) < settings.steps
    subprocess.run(command, check=True)
    assert_equal(numbers(tmp_path / "whole"), numbers(folder))


def test_a_checkpoint_that_is_damaged_or_of_other_settings_is_named(tmp_path: Path) -> None:
    train(small(tmp_path), console=quiet())
    settings = json.loads((tmp_path / "settings.json").read_text())
    (tmp_path / "settings.json").write_text(json.dumps({**settings, "versions": [0]}))
    with pytest.raises(RunFolderError, match=r"holds a run with versions=\[0\], not \[\d+\]"):
        train(small(tmp_path), console=quiet())
    (tmp_path / "settings.json").write_text(json.dumps({**settings, "hidden": [8, 8]}))
    with pytest.raises(RunFolderError, match="does not fit"):
        resume(tmp_path)
    path = tmp_path / "checkpoint.pt"
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(RunFolderError, match=r"checkpoint\.pt is damaged"):
        resume(tmp_path)
    (tmp_path / "settings.json").unlink()
    with pytest.raises(RunFolderError, match=r"has best\.safetensors, but no settings\.json of a run"):
        train(small(tmp_path), console=quiet())


def test_a_folder_in_use(tmp_path: Path) -> None:
    with locked(tmp_path), pytest.raises(RunFolderError, match=f"process {os.getpid()} uses"):
        train(small(tmp_path), console=quiet())
    assert not (tmp_path / "settings.json").exists()
