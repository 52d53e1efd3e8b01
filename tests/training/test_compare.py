import csv
import json
from pathlib import Path

import numpy as np
import pytest

import posse
from posse_baselines import PolicyError
from posse_training.cli import main
from posse_training.compare import Settings, compare


def test_differences_are_those_of_the_rows(tmp_path: Path) -> None:
    names = ("idle", "pursuit")
    rows = compare(Settings(names, ("constant",), episodes=20, out=tmp_path))
    scores = {}
    for name in names:
        with (tmp_path / f"constant-{name}.csv").open(newline="") as file:
            scores[name] = np.array([float(row["score"]) for row in csv.DictReader(file)])
    assert rows[0]["difference"] is None
    gap = scores["pursuit"] - scores["idle"]
    assert rows[1]["difference"].value == pytest.approx(gap.mean())
    assert rows[1]["improvement"].value == pytest.approx(((gap > 0) + 0.5 * (gap == 0)).mean())
    assert rows[1]["difference"].count == 20
    written = json.loads((tmp_path / "summary.json").read_text())
    assert written["comparison"][1]["score"]["value"] == pytest.approx(scores["pursuit"].mean())
    assert (written["seed"], written["split"]) == (7, "test")


def test_an_unknown_name_stops_before_anything_is_played(tmp_path: Path) -> None:
    with pytest.raises(PolicyError, match="unknown policy 'idel'"):
        compare(Settings(("idle", "idel"), ("constant",), out=tmp_path))
    with pytest.raises(posse.ScenarioError, match="unknown scenario 'konstant'"):
        compare(Settings(("idle",), ("konstant",), out=tmp_path))
    assert list(tmp_path.iterdir()) == []


def test_the_command_prints_a_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["compare", "idle", "pursuit", "--scenarios", "constant", "--episodes", "3"]
    assert main([*arguments, "--out", str(tmp_path)]) == 0
    assert "pursuit" in capsys.readouterr().out
