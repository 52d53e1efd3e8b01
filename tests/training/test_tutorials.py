"""The tutorials of the manual, run unchanged with few steps."""

import re
import runpy
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.numpy import load_file
from tests.support.process import ROOT

from posse_baselines import load
from posse_training import evaluate

TUTORIALS = ROOT / "docs" / "tutorials"
NUMBER = r"(\d\.\d+)"


def run(name: str, monkeypatch: pytest.MonkeyPatch, *arguments: object) -> dict[str, Any]:
    monkeypatch.setattr(sys, "argv", [name, *map(str, arguments)])
    return runpy.run_path(str(TUTORIALS / name), run_name="__main__")


@pytest.mark.long
def test_first_policy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "run"
    left = run("first_policy.py", monkeypatch, "--steps", 1000, "--out", folder, "--episodes", 2)
    policy = load(folder / "best.safetensors")
    assert policy.name == "smart-ppo-1"
    assert left["file"] == folder / "best.safetensors"
    shown = re.findall(rf"^(\S+) +{NUMBER}(?: \[|$)", capsys.readouterr().out, re.MULTILINE)
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
    assert run("add_scenario.py", monkeypatch, "--episodes", 2)["night"].name == "night"
    shown = capsys.readouterr().out
    assert "4 trackers, " in shown
    scores = dict(re.findall(rf"^(\S+) +score {NUMBER}", shown, re.MULTILINE))
    assert set(scores) == {"pursuit", "ddcs-distributed", "planner"}
    assert float(scores["pursuit"]) < float(scores["planner"])


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
