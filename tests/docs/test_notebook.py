"""The notebook and the loop of the manual run as they stand, the training for a moment."""

from __future__ import annotations

import json
import runpy
from pathlib import Path

import pytest
from tests.support.process import printed

import posse
from posse_baselines import load, play

HOMES = ("IPYTHONDIR", "JUPYTER_RUNTIME_DIR")
DOCS = Path(__file__).parents[2] / "docs"


def test_the_loop_plays_an_episode(capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(DOCS / "tutorials" / "step_loop.py"))
    policy = load("ddcs-distributed")
    batch = posse.batch("smart", 1, seed=1, message_size=policy.message_size)
    assert float(capsys.readouterr().out) == play(batch, policy)["safe_score"][0]


def test_the_loop_is_in_the_readme_the_notebook_and_ten_lines_long() -> None:
    loop = (DOCS / "tutorials" / "step_loop.py").read_text(encoding="utf-8").strip()
    assert len(loop.replace("\n\n", "\n").splitlines()) == 10
    assert loop in (DOCS.parent / "README.md").read_text(encoding="utf-8")
    notebook = json.loads((DOCS / "tutorials" / "notebook.ipynb").read_text(encoding="utf-8"))
    assert loop in ["".join(cell["source"]) for cell in notebook["cells"]]


@pytest.mark.long
def test_the_notebook_runs(tmp_path: Path) -> None:
    pytest.importorskip("nbclient", reason="no nbclient: pip install '.[docs]'")
    out = tmp_path / "out.ipynb"
    short = {"POSSE_NOTEBOOK_STEPS": "1000", "POSSE_NOTEBOOK_EPISODES": "2"}
    script = DOCS / "drawing" / "notebook.py"
    printed(script, "--out", out, **short, **{name: str(tmp_path) for name in HOMES})
    cells = json.loads(out.read_text(encoding="utf-8"))["cells"]
    text = [json.dumps(cell.get("outputs", "")) for cell in cells]
    assert sum("<iframe srcdoc" in outputs for outputs in text) == 2
    compared = next(outputs for outputs in text if "pngl-l-phi  " in outputs)
    assert "smart-ppo-1" in compared
