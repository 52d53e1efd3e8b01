"""Without the packages of an extra, commands work or name what to install."""

import subprocess
from collections.abc import Iterable
from pathlib import Path

import pytest
from tests.support.process import python

pytestmark = pytest.mark.long
EXTRAS = {
    "training": ["torch", "stable_baselines3", "sb3_contrib", "tensordict", "torchrl", "tensorboard", "wandb"],
    "datasets": ["minari"],
    "export": ["onnx"],
    "cluster": ["ray"],
    "video": ["imageio_ffmpeg", "moviepy"],
}
BLOCK = """
import sys

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in BLOCKED:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Blocker())
"""


def run(code: str, *arguments: str, cwd: Path, without: Iterable[str] = EXTRAS) -> subprocess.CompletedProcess[str]:
    """Run code in a process in which no package of some extras can be imported."""
    blocked = [package for extra in without for package in EXTRAS[extra]]
    return python("-c", f"BLOCKED = {blocked!r}\n{BLOCK}\n{code}", *arguments, cwd=cwd)


MAIN = "from posse_training.cli import main; sys.exit(main(sys.argv[1:]))"


@pytest.mark.parametrize("package", ["posse_training.sb3", "posse_training.torchrl"])
def test_importing_says_what_to_install(tmp_path: Path, package: str) -> None:
    done = run(f"import {package}", cwd=tmp_path)
    assert done.returncode == 1
    assert "pip install '.[training]'" in done.stderr.splitlines()[-1]


@pytest.mark.parametrize(
    "arguments",
    [
        ["scenarios"],
        *([command, "--help"] for command in ("train", "record", "export")),
        ["watch", "idle", "--scenario", "paper-distributed", "--out", "film.gif", "--seconds", "1"],
        ["replay", "idle", "--scenario", "constant", "--out", "replay.html"],
    ],
    ids=lambda arguments: " ".join(arguments[:2]),
)
def test_all_else_works_without_extras(tmp_path: Path, arguments: list[str]) -> None:
    done = run(MAIN, *arguments, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        ("training", "train"),
        ("datasets", "record idle --scenario constant --out here"),
        ("export", "export evader --out here.onnx"),
        ("video", "watch idle --out film.mp4"),
        ("cluster", "compare idle --episodes 2 --ray"),
    ],
)
def test_commands_say_what_to_install(tmp_path: Path, extra: str, words: str) -> None:
    done = run(MAIN, *words.split(), cwd=tmp_path, without=[extra])
    assert done.returncode == 2
    assert f"pip install '.[{extra}]'" in done.stderr
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []
