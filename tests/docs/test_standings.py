"""Tables of who scores what: ranked, escaped, from result files; a page and a replay each."""

from __future__ import annotations

import dataclasses
import importlib
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import posse
from posse_training.leaderboard import ResultFile, write_result
from posse_training.replay import read_replay

DOCS = Path(__file__).parents[2] / "docs"
WORLDS = 1000


@pytest.fixture
def standings(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[ModuleType]:
    pytest.importorskip("mkdocs", reason="no mkdocs: pip install '.[docs]'")
    monkeypatch.syspath_prepend(str(DOCS / "hooks"))
    module = importlib.import_module("standings")
    monkeypatch.setattr(module, "FOLDER", tmp_path)
    yield module
    for name in ("standings", "declared_tables"):
        sys.modules.pop(name, None)


def put(folder: Path, label: str, safe: float, **changes: object) -> None:
    rng = np.random.default_rng(len(label))
    score = np.clip(rng.normal(safe, 0.05, WORLDS), 0, 1).round(6)
    free = (rng.uniform(size=WORLDS) < 0.75).astype(float)
    rows = {"safe_score": tuple(score.tolist()), "score": tuple(score.tolist()), "contact_free": tuple(free.tolist())}
    result = ResultFile(
        label=label,
        policy_kind="code",
        policy="a.b:C",
        policy_sha256=None,
        reads_state=False,
        scenario="smart",
        scenario_version=1,
        split="test",
        seed=2026,
        posse_version="0.1.0",
        commit="932670c6b288",
        machine="m",
        replay=None,
        rows=rows,
    )
    kept = dataclasses.replace(result, **changes)  # type: ignore[arg-type]
    write_result(kept, folder / f"{abs(hash((label, safe)))}.json")


def lines(text: str, scenario: str) -> list[list[str]]:
    part = text.split(f"### {scenario}\n")[1].split("###")[0]
    return [
        [cell.strip() for cell in line.strip("|").split("|")] for line in part.splitlines() if line.startswith("|")
    ][2:]


def test_teams_are_ranked_by_the_safe_score(standings: ModuleType, tmp_path: Path) -> None:
    put(tmp_path, "third", 0.3)
    put(tmp_path, "first", 0.8, replay="https://example.org/r.html")
    put(tmp_path, "second", 0.5)
    put(tmp_path, "all-knowing", 0.9, reads_state=True)
    rows = lines(standings.leaderboard(), "smart")
    assert [row[0] for row in rows] == ["", "1", "2", "3"]
    assert [row[1] for row in rows[1:]] == [f"<span>{n}</span>" for n in ("first", "second", "third")]
    assert "all-knowing</span> (reference)" in rows[0][1]
    value, low, high = (float(n) for n in re.findall(r"[\d.]+", rows[1][2]))
    assert low < value < high
    assert value == pytest.approx(0.8, abs=0.01)
    assert rows[1][3] == "{:.1f} %".format(100 * (np.array(free_of("first")) == 1).mean())
    assert rows[1][4:7] == ["1,000", "2026", "`932670c`"]
    assert rows[1][7] == '<a href="https://example.org/r.html">replay</a>'


def free_of(label: str) -> list[float]:
    rng = np.random.default_rng(len(label))
    rng.normal(0.5, 0.05, WORLDS)
    return [float(value < 0.75) for value in rng.uniform(size=WORLDS)]


def test_every_row_in_the_repository_has_a_replay(standings: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(standings, "FOLDER", DOCS.parent / "benchmarks" / "leaderboard")
    found = standings.results()
    assert len(found) > 100
    for result in found:
        link = re.fullmatch(r'<a href="(site:)?(.+)">replay</a>', standings.replay_link(result))
        assert link, f"run docs/drawing/gallery.py: {result.policy} on {result.scenario}"
        assert not link[1] or (DOCS / link[2]).is_file()


def test_other_worlds_and_versions_are_not_listed(standings: ModuleType, tmp_path: Path) -> None:
    put(tmp_path, "other seed", 0.9, seed=1)
    put(tmp_path, "other split", 0.9, split="train")
    put(tmp_path, "other version", 0.9, scenario_version=99)
    short = dict.fromkeys(("safe_score", "score"), (0.5,) * 10) | {"contact_free": (1.0,) * 10}
    put(tmp_path, "few worlds", 0.9, rows=short)
    assert lines(standings.leaderboard(), "smart") == []


def test_a_hostile_label_is_text(standings: ModuleType, tmp_path: Path) -> None:
    put(tmp_path, "<script>alert(1)</script> | `x`", 0.5)
    for text in (standings.leaderboard(), standings.scores("smart")):
        assert "<script" not in text
        assert "&lt;script&gt;alert(1)&lt;/script&gt; &#124; &#96;x&#96;" in text


def test_a_forged_file_stops_the_build(standings: ModuleType, tmp_path: Path) -> None:
    (tmp_path / "forged.json").write_text("{}", encoding="utf-8")
    with pytest.raises(Exception, match=r"forged\.json: it lacks"):
        standings.leaderboard()


@pytest.mark.parametrize("name", posse.scenario_names())
def test_each_scenario_has_a_page_with_a_replay_of_its_version(name: str) -> None:
    page = DOCS / "scenarios" / f"{'paper' if name.startswith('paper') else name}.md"
    assert f"{{{{ replay {name} }}}}" in page.read_text(encoding="utf-8")
    file = DOCS / "media" / "replays" / f"{name}.html"
    assert file.stat().st_size <= 150_000
    world = read_replay(file).world
    assert (world["scenario"], world["version"]) == (name, posse.get_scenario(name).version)
