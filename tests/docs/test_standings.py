"""Tables of who scores what: ranked, from one table of standings; and the replays that pages show."""

from __future__ import annotations

import dataclasses
import importlib
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

import posse
from posse_training.leaderboard import Standing, standings_text

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


def test_a_label_that_a_page_would_read_as_markdown_stops_the_build(
    hooks: tuple[ModuleType, ModuleType], tmp_path: Path
) -> None:
    put(tmp_path, {"label": "LABEL"})
    path = tmp_path / "standings.csv"
    hostile = "![p](https://x.invalid/p){: onerror=alert(1) }"
    path.write_text(path.read_text(encoding="utf-8").replace("LABEL", hostile), encoding="utf-8")
    for made in (hooks[0].leaderboard, hooks[0].results):
        with pytest.raises(Exception, match=r"standings\.csv, line 2: label=.* must be at most 100 letters"):
            made()


def test_at_most_eight_replays_each_in_the_gallery(hooks: tuple[ModuleType, ModuleType]) -> None:
    replays, text = hooks[1].REPLAYS, (DOCS / "scenarios.md").read_text(encoding="utf-8")
    assert len(replays) <= 8
    made = "".join(hooks[1].scenario(name) for name in re.findall(r"\{\{ scenario (\S+) \}\}", text))
    assert set(re.findall(r"media/replays/(\S+)\.html", made)) == set(replays)


@pytest.mark.parametrize("name", posse.scenario_names())
def test_each_scenario_is_in_the_gallery(name: str) -> None:
    assert re.search(rf"^### .*\b{name}\b", (DOCS / "scenarios.md").read_text(encoding="utf-8"), re.MULTILINE)
