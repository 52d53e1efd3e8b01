"""The manual: it documents every public name, finds them, loads nothing from elsewhere, and fits a phone."""

import fcntl
import functools
import html
import http.server
import importlib
import os
import re
import threading
from pathlib import Path

import pytest
from tests.support.browser import chromium
from tests.support.pages import ROOT
from tests.support.process import printed

import posse

DOCS = ROOT / "docs"
MODULES = ("posse", "posse_baselines", "posse_training", "posse_training.replay", "posse_training.leaderboard")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the manual, once for all modules and processes of a run."""
    pytest.importorskip("mkdocs", reason="no mkdocs: pip install '.[docs]'")
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    folder, partial = shared / "manual", shared / "manual.partial"
    with (shared / "manual.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not folder.exists():
            printed("-m", "mkdocs", "build", "--strict", "-d", partial, NO_MKDOCS_2_WARNING="1")
            partial.rename(folder)
    return folder


def test_the_manual_is_short() -> None:
    pages = [*DOCS.rglob("*.md")]
    texts = [path.read_text(encoding="utf-8") for path in (*pages, ROOT / "CONTRIBUTING.md")]
    assert len(pages) <= 25
    assert sum(len(re.findall(r"\S*\w\S*", text)) for text in texts) <= 15_000


@pytest.mark.parametrize("module", MODULES)
def test_every_public_name_is_in_the_reference(site: Path, module: str) -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in (site / "reference").rglob("*.html"))
    names = importlib.import_module(module).__all__
    assert [name for name in names if f'id="{module}.{name}"' not in text] == []


def test_every_setting_is_in_the_manual(site: Path) -> None:
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
