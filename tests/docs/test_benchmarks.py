"""The command that measures throughput runs, with little time for each figure."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.long
def test_it_measures(tmp_path: Path) -> None:
    paths = [str(ROOT / root) for root in ("envs", "baselines", "training")]
    done = subprocess.run(
        [sys.executable, str(ROOT / "benchmarks" / "speed.py"), "--worlds", "2", "--no-cold", "--seconds", "0.01"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
    )
    assert done.returncode == 0, done.stderr[-3000:]
    figures = json.loads((tmp_path / "runs" / "bench" / "speed.json").read_text(encoding="utf-8"))
    assert {"machine", "batches", "one_world"} <= figures.keys()
