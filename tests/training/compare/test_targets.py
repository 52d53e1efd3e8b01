"""Evaluation, comparison, films and replays against a given target."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.support.learned import target_for

import posse
from posse_training import evaluate
from posse_training.commands import watch
from posse_training.compare.compare import SUMMARY, Settings, compare
from posse_training.replay import record

SHORT = posse.get_scenario("smart", num_trackers=3, horizon=30, settle_time=1.0)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "evader.safetensors"
    target_for(SHORT).save(path)
    return path


def test_an_evaluation_names_the_target_and_is_the_same_alone(file: Path, tmp_path: Path) -> None:
    play: dict[str, Any] = {"target": str(file), "progress": False}
    many = evaluate("ddcs-distributed", SHORT, 5, **play)
    few = evaluate("ddcs-distributed", SHORT, 2, **play)
    for name, column in few.columns.items():
        np.testing.assert_array_equal(column, many[name][:2], name)
    scripted = evaluate("ddcs-distributed", SHORT, 5, progress=False)
    assert not np.array_equal(many["tracking_error"], scripted["tracking_error"])
    assert many.target == "evading"
    assert scripted.target is None
    assert many.scenario.to_dict()["target_motion"] == "agent"
    many.write(tmp_path / "rows.csv")
    text = (tmp_path / "rows.csv").read_text(encoding="utf-8")
    rows = list(csv.DictReader(text.splitlines()))
    assert {row["target"] for row in rows} == {"evading"}
    assert json.loads((tmp_path / "rows.json").read_text())["target"] == "evading"


def test_a_comparison_plays_every_team_against_the_target(file: Path, tmp_path: Path) -> None:
    code = "posse_baselines.policies.simple:Idle"
    made: dict[str, Any] = {"out": tmp_path / "out", "figures": False, "planner_episodes": 1, "target": str(file)}
    found = compare(Settings(("ddcs-distributed", code), ("smart",), episodes=2, **made))
    played = {plays.results[0].target for plays in found.plays.values()}
    assert played == {"evading"}
    assert len(found.plays) == 2, "also in the process of a policy that is code"
    assert "planner" in found.left_out[0]["policy"]
    assert json.loads((tmp_path / "out" / SUMMARY).read_text())["target"] == str(file)


def test_a_replay_and_a_film_show_the_target(file: Path, tmp_path: Path) -> None:
    replay = record(["pursuit"], SHORT, target=str(file), seconds=2.0)
    actions = replay.players[0].columns["action"]
    assert actions.shape[1] == SHORT.num_trackers + 1, "the target's action as well"
    film = tmp_path / "film.gif"
    asked = ["pursuit", "--scenario", "smart", "--target", str(file), "--set", "num_trackers=3"]
    watch.main([*asked, "--out", str(film), "--seconds", "0.3"])
    assert film.is_file()
