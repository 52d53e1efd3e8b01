"""The cases of ``tests/support/ray_cases.py``, in the virtual environment that has Ray."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.support.process import printed

ROOT = Path(__file__).parents[3]
ELSEWHERE = ROOT / ".venv-recipes" / "bin" / "python"


@pytest.mark.long
def test_on_a_cluster_of_two_nodes(tmp_path: Path) -> None:
    if not ELSEWHERE.exists():
        pytest.skip("Ray is not installed: make recipes")
    words = f"-W ignore -m pytest -q -p no:cacheprovider -n 0 -W ignore --basetemp {tmp_path / 'cases'}"
    printed(*words.split(), "tests/support/ray_cases.py", program=ELSEWHERE, RAY_AUTH_MODE="disabled")
