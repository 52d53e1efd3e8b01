"""The cases of ``tests/support/ray_cases.py``, in the virtual environment that has Ray."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
ELSEWHERE = ROOT / ".venv-recipes" / "bin" / "python"


@pytest.mark.long
def test_on_a_cluster_of_two_nodes(tmp_path: Path) -> None:
    if not ELSEWHERE.exists():
        pytest.skip("Ray is not installed: make recipes")
    paths = [str(ROOT), *(str(ROOT / root) for root in ("envs", "baselines", "training"))]
    words = f"-W ignore -m pytest -q -p no:cacheprovider -n 0 -W ignore --basetemp {tmp_path / 'cases'}"
    done = subprocess.run(
        [ELSEWHERE, *words.split(), "tests/support/ray_cases.py"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=500,
        check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths), "RAY_AUTH_MODE": "disabled"},
    )
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-2000:]
