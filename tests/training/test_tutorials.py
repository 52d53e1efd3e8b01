"""The tutorials of the manual, run unchanged with few steps."""

from __future__ import annotations

import os
import re
import runpy
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.numpy import load_file

import posse
from posse_baselines import load
from posse_training import evaluate

ROOT = Path(__file__).parents[2]
TUTORIALS = ROOT / "docs" / "tutorials"
NUMBER = r"(\d\.\d+)"


@pytest.fixture(autouse=True)
def threads() -> Iterator[None]:
    """Restore torch's number of threads, which a tutorial may change."""
    before = torch.get_num_threads()
    yield
    torch.set_num_threads(before)


def run(name: str, monkeypatch: pytest.MonkeyPatch, *arguments: object) -> dict[str, Any]:
    monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
    return runpy.run_path(str(TUTORIALS / name), run_name="__main__")


@pytest.mark.long
def test_first_policy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "run"
    left = run("first_policy.py", monkeypatch, "--steps", 1000, "--folder", folder, "--episodes", 2)
    policy = load(folder / "best.safetensors")
    assert policy.name == "smart-ppo-1"
    assert left["file"] == folder / "best.safetensors"
    shown = re.findall(rf"^(\S+) +{NUMBER} \[", capsys.readouterr().out, re.MULTILINE)
    assert [name for name, _ in shown] == ["pursuit", "ddcs-distributed", "smart-ppo-1"]
    mine = evaluate(policy, "smart", episodes=2, progress=False)["score"].mean()
    assert float(shown[2][1]) == pytest.approx(mine, abs=1e-3)


def test_own_policy(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    run("own_policy.py", monkeypatch, "--episodes", 30)
    shown = dict(re.findall(rf"^(\S+) +score {NUMBER}", capsys.readouterr().out, re.MULTILINE))
    assert float(shown["pursuit"]) < float(shown["own-slot"]) < float(shown["ddcs-distributed"])
    # As in the tutorial, a class is loaded by module and name, and plays with messages.
    monkeypatch.syspath_prepend(str(TUTORIALS))
    policy = load("own_policy:OwnSlot")
    results = evaluate(policy, "search", 2, message_size=3, horizon=50, progress=False)
    assert np.isfinite(results["score"]).all()


def test_add_scenario(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    left = run("add_scenario.py", monkeypatch, "--episodes", 3)
    assert left["night"].name == "night"
    shown = capsys.readouterr().out
    assert "4 trackers, " in shown
    scores = dict(re.findall(rf"^(\S+) +score {NUMBER}", shown, re.MULTILINE))
    assert set(scores) == {"pursuit", "ddcs-distributed", "planner"}
    assert float(scores["pursuit"]) < float(scores["planner"])


def test_reward_term() -> None:
    done = subprocess.run(
        [sys.executable, "-W", "error", str(TUTORIALS / "reward_term.py"), "--steps", "5"],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    lines = re.findall(rf"(\w+): steady (\d), reward {NUMBER} = {NUMBER}", done.stdout)
    assert [steady for _, steady, *_ in lines] == ["1", "0", "0", "0", "0"]
    assert all(reward == expected for *_, reward, expected in lines)
    assert float(lines[0][2]) == pytest.approx(0.1, abs=0.005)


def test_one_tracker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "one.zip"
    left = run("one_tracker.py", monkeypatch, "--steps", 64, "--rollout", 64, "--episodes", 1, "--file", file)
    assert file.is_file()
    weights = [model.policy.state_dict() for model in (left["model"], left["learned"])]
    assert all(torch.equal(weights[0][name], weights[1][name]) for name in weights[0])
    found = re.search(rf"score of the team {NUMBER} in 1 worlds", capsys.readouterr().out)
    assert found is not None
    # The four others are scripted and reach most of their slots, whatever the learner does.
    assert float(found[1]) > 0.4


def test_cleanrl_ppo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "deep" / "ppo.safetensors"
    left = run("cleanrl_ppo.py", monkeypatch, "--steps", 6200, "--envs", 2, "--rollout", 620, "--file", file)
    shown = capsys.readouterr().out
    assert re.search(rf"6,200 steps  score {NUMBER}  reward", shown)  # an episode has ended
    numbers = load_file(file)
    assert all(np.isfinite(array).all() for array in numbers.values())
    assert not np.array_equal(numbers["mean"], np.zeros_like(numbers["mean"]))
    # A truncated episode has a value after its end, and advantages do not cross the end.
    assert left["ends"].sum() == 10  # two worlds of five trackers, once each
    at = left["ends"].nonzero()[0, 0]
    assert (left["nexts"][at] != 0).all()
    step = left["rewards"] + left["args"].discount * left["nexts"] - left["values"]
    torch.testing.assert_close(left["advantages"][at], step[at])
    assert (left["advantages"][at - 1] != step[at - 1]).all()


def test_every_tutorial_is_tried_and_has_its_place_in_the_manual() -> None:
    tests = Path(__file__).read_text()
    page = "".join((ROOT / "docs" / name).read_text() for name in ("tutorials/index.md", "add_policy.md"))
    elsewhere = {"notebook.ipynb", "step_loop.py"}  # tests/docs/test_notebook.py
    names = {path.name for path in TUTORIALS.iterdir() if path.suffix != ".md"}
    files = sorted(names - elsewhere)
    assert len(files) == 6
    for name in files:
        assert f'"{name}"' in tests
        assert f'--8<-- "docs/tutorials/{name}"' in page
    assert "steady" not in {term.name for term in posse.REWARD_TERMS}  # or its tutorial is out
