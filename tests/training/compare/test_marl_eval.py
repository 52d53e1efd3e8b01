"""The exported file has marl-eval's layout and the numbers of the rows."""

from __future__ import annotations

import csv
import json
from pathlib import Path

from posse_training.compare.compare import Settings, compare


def test_the_export_holds_every_worlds_metrics(tmp_path: Path) -> None:
    out = tmp_path / "out"
    compare(
        Settings(
            policies=("idle", "pursuit"),
            scenario=("constant",),
            episodes=3,
            out=out,
            figures=False,
            planner_episodes=0,
            export=("marl-eval",),
        )
    )
    whole = json.loads((out / "marl-eval.json").read_text(encoding="utf-8"))
    assert list(whole) == ["posse"]
    assert set(whole["posse"]["constant"]) == {"idle", "pursuit"}
    run = whole["posse"]["constant"]["pursuit"]["seed_0"]
    with (out / "constant-pursuit.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for name in ("score", "safe_score"):
        expected = [float(row[name]) for row in rows]
        assert run["absolute_metrics"][name] == expected
        assert run["step_0"][name] == expected
    assert run["step_0"]["step_count"] == 0
