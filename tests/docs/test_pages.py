"""What pages show: drawings of laws, the table of the README, the loop and the notebook, and the speed benchmark."""

from __future__ import annotations

import dataclasses
import importlib
import json
import re
import runpy
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest
from tests.support.process import printed

import posse
from posse_baselines import load, play, policy_names
from posse_training.leaderboard import Standing, standings_text

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "policies.md").read_text(encoding="utf-8")


def test_every_policy_of_the_package_is_on_the_page() -> None:
    assert [name for name in policy_names() if f"`{name}`" not in PAGE] == []


ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.fixture
def readme_table(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    pytest.importorskip("mkdocs", reason="no mkdocs: pip install '.[docs]'")
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "drawing"))
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "hooks"))
    yield importlib.import_module("readme_table")
    for name in ("readme_table", "standings", "declared_tables"):
        sys.modules.pop(name, None)


def test_the_table_is_made_from_the_result_files(readme_table: ModuleType) -> None:
    assert readme_table.with_table(README) == README


HOMES = ("IPYTHONDIR", "JUPYTER_RUNTIME_DIR")


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


@pytest.mark.long
def test_the_speed_benchmark_measures(tmp_path: Path) -> None:
    printed(ROOT / "benchmarks" / "speed.py", "--worlds", "2", "--no-cold", "--seconds", "0.01", cwd=tmp_path)
    figures = json.loads((tmp_path / "runs" / "bench" / "speed.json").read_text(encoding="utf-8"))
    assert {"machine", "batches", "one_world"} <= figures.keys()


DOCS = Path(__file__).parents[2] / "docs"
ROW = Standing("a team", "a.b:C", False, "smart", 1, "test", 2026, 1000, 0.5, 0.4, 0.6, 0.7, 0.75, "932670c6b288")


@pytest.fixture
def hooks(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[tuple[ModuleType, ModuleType]]:
    pytest.importorskip("mkdocs", reason="no mkdocs: pip install '.[docs]'")
    monkeypatch.syspath_prepend(str(DOCS / "hooks"))
    standings, replays = importlib.import_module("standings"), importlib.import_module("replays")
    monkeypatch.setattr(standings, "STANDINGS", tmp_path / "standings.csv")
    yield standings, replays
    for name in ("standings", "replays", "declared_tables"):
        sys.modules.pop(name, None)


def put(folder: Path, *changes: dict[str, object]) -> None:
    rows = [dataclasses.replace(ROW, **change) for change in changes]  # type: ignore[arg-type]
    (folder / "standings.csv").write_text(standings_text(rows), encoding="utf-8")


def lines(text: str, scenario: str) -> list[list[str]]:
    part = text.split(f"### {scenario}\n")[1].split("###")[0]
    return [
        [cell.strip() for cell in line.strip("|").split("|")] for line in part.splitlines() if line.startswith("|")
    ][2:]


def test_teams_are_ranked_by_the_safe_score(hooks: tuple[ModuleType, ModuleType], tmp_path: Path) -> None:
    put(
        tmp_path,
        {"label": "third", "safe_score": 0.45},
        {"label": "first", "safe_score": 0.55, "seed": 7},
        {"label": "second"},
        {"label": "knows", "safe_score": 0.6, "reads_state": True, "worlds": 100},
    )
    rows = lines(hooks[0].leaderboard(), "smart")
    assert [row[:2] for row in rows] == [["", "knows (reference)"], ["1", "first"], ["2", "second"], ["3", "third"]]
    assert rows[1][2:] == ["0.550&nbsp;[0.400,&nbsp;0.600]", "75.0%", "1,000", "7", "`932670c`"]


def test_other_splits_versions_and_few_worlds_are_not_listed(
    hooks: tuple[ModuleType, ModuleType], tmp_path: Path
) -> None:
    put(tmp_path, {"split": "train"}, {"version": 99}, {"worlds": 999}, {"scenario": "gone"})
    assert lines(hooks[0].leaderboard(), "smart") == []


def test_at_most_eight_replays_each_in_the_gallery(hooks: tuple[ModuleType, ModuleType]) -> None:
    replays, text = hooks[1].REPLAYS, (DOCS / "scenarios.md").read_text(encoding="utf-8")
    assert len(replays) <= 8
    made = "".join(hooks[1].scenario(name) for name in re.findall(r"\{\{ scenario (\S+) \}\}", text))
    assert set(re.findall(r"media/replays/(\S+)\.html", made)) == set(replays)


@pytest.mark.parametrize("name", posse.scenario_names())
def test_each_scenario_is_in_the_gallery(name: str) -> None:
    assert re.search(rf"^### .*\b{name}\b", (DOCS / "scenarios.md").read_text(encoding="utf-8"), re.MULTILINE)
