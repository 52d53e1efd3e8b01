"""A resumed run is bit-identical to an uninterrupted one; errors of a run folder are named, and no data are lost."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from tests.support.runs import (
    AGAINST,
    BELIEVING,
    GUARDED,
    TARGET,
    assert_equal,
    killed_at,
    numbers,
    quiet,
    resume,
    small,
    steps_saved,
)

from posse_training.errors import RunFolderError
from posse_training.files import locked
from posse_training.train import TrainSettings, checkpoint
from posse_training.train.train import train


@pytest.mark.parametrize(
    ("algorithm", "changes"),
    [
        ("ppo", {}),
        *(pytest.param(name, {}, marks=pytest.mark.long) for name in ("mappo", "sac", "td3")),
        ("ppo", BELIEVING),
        ("ppo", GUARDED),
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
    resume(tmp_path / "cut")
    assert_equal(numbers(tmp_path / "whole"), numbers(tmp_path / "cut"))


SCRIPT = """
import json, sys
from posse_training.train import TrainSettings
from posse_training.train.train import train
train(TrainSettings.from_dict(json.loads(sys.argv[1])))
"""


def start(folder: Path, settings: TrainSettings) -> subprocess.Popen[bytes]:
    """Train, or resume."""
    told = json.dumps({**settings.to_dict(), "folder": str(folder)})
    return subprocess.Popen([sys.executable, "-c", SCRIPT, told])


@pytest.mark.long
def test_kill_9_loses_at_most_one_interval(tmp_path: Path) -> None:
    settings = small(tmp_path / "x", steps=16_000, evaluate_every=8000, checkpoint_every=800)
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    assert start(whole, settings).wait() == 0
    running = start(killed, settings)
    kills = 0
    for target in (800, 8000):
        reached = -1
        while running.poll() is None and reached < target:
            time.sleep(0.01)
            if (killed / "checkpoint.pt").exists():
                reached = steps_saved(killed)
        if running.poll() is not None:
            break
        os.kill(running.pid, signal.SIGKILL)
        assert running.wait() == -signal.SIGKILL
        kills += 1
        kept = steps_saved(killed)
        assert kept >= reached  # what was kept stays kept
        running = start(killed, settings)
    assert kills >= 1
    assert running.wait() == 0
    assert_equal(numbers(whole), numbers(killed))


def test_a_finished_training_can_be_gone_on_with_for_longer(tmp_path: Path) -> None:
    train(small(tmp_path / "run"), console=quiet())
    resume(tmp_path / "run", steps=1920)
    assert steps_saved(tmp_path / "run") == 1920


def test_a_damaged_checkpoint(tmp_path: Path) -> None:
    train(small(tmp_path), console=quiet())
    path = tmp_path / "checkpoint.pt"
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(RunFolderError, match=r"checkpoint\.pt is damaged"):
        resume(tmp_path)


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


def test_a_folder_that_holds_another_run(tmp_path: Path) -> None:
    train(small(tmp_path), console=quiet())
    before = (tmp_path / "checkpoint.pt").read_bytes()
    with pytest.raises(RunFolderError, match=r"holds a run with seed=3, not 4: choose another --out"):
        train(small(tmp_path, seed=4), console=quiet())
    assert (tmp_path / "checkpoint.pt").read_bytes() == before


def test_a_checkpoint_of_other_settings(tmp_path: Path) -> None:
    train(small(tmp_path), console=quiet())
    settings = json.loads((tmp_path / "settings.json").read_text())
    settings["hidden"] = [8, 8]
    (tmp_path / "settings.json").write_text(json.dumps(settings))
    with pytest.raises(RunFolderError, match="does not fit"):
        resume(tmp_path)
