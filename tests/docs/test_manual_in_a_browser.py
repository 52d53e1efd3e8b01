"""Pages of the manual in a browser: they fit a phone, are short, show code whole, and ask no other host."""

from __future__ import annotations

import functools
import http.server
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import pytest
from tests.docs.test_manual import pages, site
from tests.support.browser import chromium

__all__ = ["site"]
PHONE, WIDE = (390, 844), (1300, 1000)
SCREENS = 10
LOOK = """() => {
  const count = (all, fault) => [...document.querySelectorAll('.md-typeset ' + all)].filter(fault).length;
  const { scrollWidth, scrollHeight } = document.documentElement;
  return [scrollWidth, scrollHeight, count('pre > code', e => e.scrollWidth > e.clientWidth + 1),
    count('.name', e => e.getClientRects().length > 1)];
}"""
"""Width and height of the page, blocks of code that are cut off, and names that are broken inside."""


class _Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, format: str, *args: object) -> None:  # noqa: A002
        pass


@pytest.fixture
def address(site: Path) -> Iterator[str]:
    handler = functools.partial(_Quiet, directory=str(site))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()


@pytest.mark.long
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize(("width", "screen"), [WIDE, PHONE])
def test_pages_fit_are_short_and_ask_no_other_host(
    site: Path, address: str, width: int, screen: int, scheme: Literal["light", "dark"]
) -> None:
    with chromium() as browser:
        page = browser.new_page(viewport={"width": width, "height": screen}, color_scheme=scheme)
        asked: list[str] = []
        failed: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        page.on("pageerror", lambda error: failed.append(str(error)))
        page.on("response", lambda got: failed.append(got.url) if got.status >= 400 else None)
        faults = []
        for path in pages(site):
            if path.name == "index.html":
                where = path.parent.relative_to(site).as_posix()
                page.goto(address + ("" if where == "." else where + "/"))
                wide, height, cut, broken = page.evaluate(LOOK)
                if wide > width or broken or height > SCREENS * screen or (cut and width == WIDE[0]):
                    faults.append((where, wide, height, cut, broken))
        assert [url for url in asked if not url.startswith((address, "data:", "blob:"))] == []
        assert failed == []
        assert faults == []
