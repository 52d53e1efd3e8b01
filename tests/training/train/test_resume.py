"""A resumed run is bit-identical to an uninterrupted one."""

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
from tests.support.runs import BELIEVING, GUARDED, assert_equal, numbers, quiet, small, steps_saved

from posse_training.train import TrainSettings, checkpoint
from posse_training.train.train import resume, train


@pytest.mark.parametrize(
    ("algorithm", "changes"),
    [
        ("ppo", {}),
        *(pytest.param(name, {}, marks=pytest.mark.long) for name in ("mappo", "sac", "td3")),
        ("ppo", BELIEVING),
        ("ppo", GUARDED),
    ],
)
def test_a_training_that_was_cut_ends_where_it_would_have(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, algorithm: str, changes: dict[str, Any]
) -> None:
    train(small(tmp_path / "whole", algorithm, **changes), console=quiet())
    write, count = checkpoint.write_checkpoint, 0

    def cut(*arguments: Any) -> None:
        nonlocal count
        write(*arguments)
        count += 1
        if count == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr(checkpoint, "write_checkpoint", cut)
    with pytest.raises(KeyboardInterrupt):
        train(small(tmp_path / "cut", algorithm, **changes), console=quiet())
    monkeypatch.undo()
    steps = steps_saved(tmp_path / "cut")
    assert 0 < steps < 1280
    resume(tmp_path / "cut", console=quiet())
    assert_equal(numbers(tmp_path / "whole"), numbers(tmp_path / "cut"))


SCRIPT = """
import sys
from io import StringIO
from pathlib import Path
from rich.console import Console
from posse_training.train.settings import TrainSettings
from posse_training.train.train import resume, train
import json
console = Console(file=StringIO())
if sys.argv[1] == "train":
    train(TrainSettings.from_dict(json.loads(sys.argv[3])), console=console)
else:
    resume(Path(sys.argv[2]), console=console)
"""


def start(action: str, folder: Path, settings: TrainSettings) -> subprocess.Popen[bytes]:
    told = json.dumps({**settings.to_dict(), "folder": str(folder)})
    return subprocess.Popen([sys.executable, "-c", SCRIPT, action, str(folder), told])


@pytest.mark.long
def test_kill_9_loses_at_most_one_interval(tmp_path: Path) -> None:
    settings = small(tmp_path / "x", steps=16_000, evaluate_every=8000, checkpoint_every=800)
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    assert start("train", whole, settings).wait() == 0
    running = start("train", killed, settings)
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
        running = start("resume", killed, settings)
    assert kills >= 1
    assert running.wait() == 0
    assert_equal(numbers(whole), numbers(killed))


def test_a_finished_training_can_be_gone_on_with_for_longer(tmp_path: Path) -> None:
    train(small(tmp_path / "run"), console=quiet())
    resume(tmp_path / "run", console=quiet(), steps=1920)
    assert steps_saved(tmp_path / "run") == 1920
