"""The commands that measure throughput run, with little time for each figure."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]


def figures_of(command: str, folder: Path) -> Any:
    """Run a script of benchmarks/, and return the file of figures that it writes."""
    script, *arguments = command.split()
    paths = [str(ROOT / root) for root in ("envs", "baselines", "training")]
    done = subprocess.run(
        [sys.executable, str(ROOT / "benchmarks" / script), *arguments, "--seconds", "0.01", "--out", "figures.json"],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads((folder / "figures.json").read_text())


@pytest.mark.long
@pytest.mark.parametrize(("command", "parts"), [("speed.py --worlds 2 --no-cold", {"batches", "one_world"})])
def test_it_measures(command: str, parts: set[str], tmp_path: Path) -> None:
    assert parts <= figures_of(command, tmp_path).keys()
