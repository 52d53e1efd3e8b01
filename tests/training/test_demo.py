"""The demo says how the teams do, then where the replay and the film are."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from PIL import Image
from tests.support.process import printed

from posse_training import demo
from posse_training.cli import main
from posse_training.evaluation import evaluate
from posse_training.replay.page import read_replay


def test_a_line_for_each_team_then_the_replay_and_the_film(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    teams = {"script": "ddcs-tuned", "learned": "learned-smart", "planner": "pursuit"}
    monkeypatch.setattr(demo, "TEAMS", teams)
    assert main(["demo", "--episodes", "10", "--seconds", "0.5", "--out", "shown"]) == 0
    lines = capsys.readouterr().out.strip().splitlines()
    for (kind, name), line, worlds in zip(teams.items(), lines, (10, 10, 2), strict=False):
        held = evaluate(name, "smart", worlds, 7, progress=False)["safe_score"].mean()
        assert re.fullmatch(rf"{kind} +{name} +held {100 * held:.0f} ± \d+ % of its slots in {worlds} worlds", line)
    assert lines[4].startswith("replay: shown/replay.html")
    assert lines[5] == "film:   shown/smart.gif"
    assert [player.name for player in read_replay("shown/replay.html").players] == ["ddcs-tuned", "learned-smart"]
    with Image.open("shown/smart.gif") as film:
        assert film.size == (800, 525)


def test_it_needs_no_torch() -> None:
    code = "import sys, posse_training.demo; print('torch' in sys.modules)"
    assert printed("-c", code).strip() == "False"
