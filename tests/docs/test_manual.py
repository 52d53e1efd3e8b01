"""The manual: it documents every public name, loads nothing from elsewhere, fits a phone; and what its pages show."""

import dataclasses
import functools
import html
import http.server
import importlib
import json
import re
import runpy
import threading
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from tests.support.browser import chromium
from tests.support.process import ROOT, printed

import posse
from posse_baselines import batch_for, load, play, policy_names
from posse_training.leaderboard import Standing, standings_text

DOCS = ROOT / "docs"
README = (ROOT / "README.md").read_text(encoding="utf-8")
SCENARIOS = (DOCS / "scenarios.md").read_text(encoding="utf-8")
MODULES = ("posse", "posse_baselines", "posse_training", "posse_training.replay", "posse_training.leaderboard")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the manual."""
    pytest.importorskip("mkdocs", reason="no mkdocs: pip install '.[docs]'")
    folder = tmp_path_factory.mktemp("manual")
    printed("-m", "mkdocs", "build", "--strict", "-d", folder, NO_MKDOCS_2_WARNING="1")
    return folder


def test_the_manual_is_short() -> None:
    pages = [*DOCS.rglob("*.md")]
    texts = [path.read_text(encoding="utf-8") for path in (*pages, ROOT / "CONTRIBUTING.md")]
    assert len(pages) <= 25
    assert sum(len(re.findall(r"\S*\w\S*", text)) for text in texts) <= 15_000


def test_every_public_name_and_setting_is_in_the_manual(site: Path) -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in (site / "reference").rglob("*.html"))
    names = [f"{module}.{name}" for module in MODULES for name in importlib.import_module(module).__all__]
    assert [name for name in names if f'id="{name}"' not in text] == []
    page = (site / "scenarios" / "index.html").read_text(encoding="utf-8")
    text = html.unescape(re.sub("<.*?>", "", page))
    wanted = [word for name, setting in posse.Scenario.settings().items() for word in (name, setting.meaning)]
    assert [word for word in wanted if word not in text] == []


PHONE, WIDE = (390, 844), (1300, 1000)
SCREENS = 10
LOOK = """() => {
  const count = (all, fault) => [...document.querySelectorAll('.md-typeset ' + all)].filter(fault).length;
  const { scrollWidth, scrollHeight } = document.documentElement;
  return [scrollWidth, scrollHeight, count('pre > code', e => e.scrollWidth > e.clientWidth + 1),
    count('.name', e => e.getClientRects().length > 1)];
}"""
"""Width and height of the page, blocks of code that are cut off, and names that are broken inside."""


@pytest.mark.long
@pytest.mark.parametrize(("width", "screen"), [WIDE, PHONE])
def test_pages_fit_are_short_and_ask_no_other_host(site: Path, width: int, screen: int) -> None:
    handler = functools.partial(http.server.SimpleHTTPRequestHandler, directory=str(site))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server, chromium() as browser:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_port}/"
        page = browser.new_page(viewport={"width": width, "height": screen})
        asked: list[str] = []
        failed: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        page.on("pageerror", lambda error: failed.append(str(error)))
        page.on("response", lambda got: failed.append(got.url) if got.status >= 400 else None)
        faults = []
        pages = sorted(site.rglob("index.html"))
        assert len(pages) > 15
        for path in pages:
            where = path.parent.relative_to(site).as_posix()
            page.goto(address + ("" if where == "." else where + "/"))
            wide, height, cut, broken = page.evaluate(LOOK)
            if wide > width or broken or height > SCREENS * screen or (cut and width == WIDE[0]):
                faults.append((where, wide, height, cut, broken))
        server.shutdown()
        assert [url for url in asked if not url.startswith((address, "data:", "blob:"))] == []
        assert failed == []
        assert faults == []


def test_every_policy_and_scenario_is_in_the_manual() -> None:
    page = (DOCS / "policies.md").read_text(encoding="utf-8")
    assert [name for name in policy_names() if f"`{name}`" not in page] == []
    heads = [line for line in SCENARIOS.splitlines() if line.startswith("### ")]
    assert [name for name in posse.scenario_names() if not re.search(rf"\b{name}\b", "\n".join(heads))] == []


def test_the_loop_plays_an_episode(capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(DOCS / "tutorials" / "step_loop.py"))
    policy = load("ddcs-distributed")
    assert float(capsys.readouterr().out) == play(batch_for(policy, "smart", seed=1), policy)["safe_score"][0]


@pytest.mark.long
def test_the_notebook_runs(tmp_path: Path) -> None:
    pytest.importorskip("nbclient", reason="no nbclient: pip install '.[docs]'")
    out = tmp_path / "out.ipynb"
    short = {"POSSE_NOTEBOOK_STEPS": "1000", "POSSE_NOTEBOOK_EPISODES": "2"}
    homes = dict.fromkeys(("IPYTHONDIR", "JUPYTER_RUNTIME_DIR"), str(tmp_path))
    printed(DOCS / "drawing" / "notebook.py", "--out", out, **short, **homes)
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


ROW = Standing("a team", "a.b:C", False, "smart", 1, 2026, 1000, 0.5, 0.48, 0.52, 0.7, 0.75, "932670c6b288")


@pytest.fixture
def hook(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], ModuleType]:
    """Import a module of the manual's."""
    pytest.importorskip("mkdocs", reason="no mkdocs: pip install '.[docs]'")
    for folder in ("drawing", "hooks"):
        monkeypatch.syspath_prepend(str(DOCS / folder))
    return importlib.import_module


def test_the_table_of_the_readme_is_made_from_the_result_files(hook: Callable[[str], ModuleType]) -> None:
    made, gain = hook("readme_table").with_table(README), re.compile(r"(?<=gain&nbsp;)[+-][\d.]+")
    assert gain.sub("", made) == gain.sub("", README)
    # For a gain the tuned script plays again, and another processor rounds otherwise.
    gains = ([float(number) for number in gain.findall(text)] for text in (made, README))
    assert next(gains) == pytest.approx(next(gains), abs=0.02)


def test_teams_are_ranked_by_the_safe_score(
    hook: Callable[[str], ModuleType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of the present version and enough worlds."""
    rows: list[dict[str, Any]] = [
        {"label": "third", "safe_score": 0.485},
        {"label": "first", "safe_score": 0.515, "seed": 7},
        {"label": "second"},
        {"label": "knows", "safe_score": 0.52, "reads_state": True, "worlds": 100},
        {"label": "slow", "safe_score": 0.518, "policy": "belief-planner", "worlds": 100},
        *({"label": "unlisted", **change} for change in ({"version": 99}, {"worlds": 999})),
    ]
    path, standings = tmp_path / "standings.csv", hook("standings")
    path.write_text(standings_text([dataclasses.replace(ROW, **row) for row in rows]), encoding="utf-8")
    monkeypatch.setattr(standings, "STANDINGS", path)
    table = standings.leaderboard().split("### smart\n")[1].split("###")[0]
    rows_of = [line.strip("|").split("|") for line in table.splitlines() if line.startswith("|")]
    listed = [[cell.strip() for cell in row] for row in rows_of[2:]]
    assert [row[0] for row in listed] == ["", "", "1", "2", "3"]
    assert [row[1] for row in listed] == ["knows (reference)", "slow (reference)", "first", "second", "third"]
