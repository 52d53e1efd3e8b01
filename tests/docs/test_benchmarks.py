"""The command that measures throughput runs, with little time for each figure."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from tests.support.process import printed

ROOT = Path(__file__).parents[2]


@pytest.mark.long
def test_it_measures(tmp_path: Path) -> None:
    printed(ROOT / "benchmarks" / "speed.py", "--worlds", "2", "--no-cold", "--seconds", "0.01", cwd=tmp_path)
    figures = json.loads((tmp_path / "runs" / "bench" / "speed.json").read_text(encoding="utf-8"))
    assert {"machine", "batches", "one_world"} <= figures.keys()
