"""The report in a real browser; skipped without one."""

from __future__ import annotations

from pathlib import Path

import pytest
from tests.support.browser import chromium, opened
from tests.support.reports import HOSTILE, compared

from posse_training.reports.pictures.palette import DARK, INK, PAPER


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("compared") / "a report"
    compared(folder)
    return folder / "report.html"


def rgb(colour: str) -> str:
    return f"rgb({', '.join(str(int(colour[k : k + 2], 16)) for k in (1, 3, 5))})"


def test_a_replay_opens_and_plays_and_nothing_hostile_runs(written: Path) -> None:
    with chromium() as browser, opened(browser, written) as page:
        assert page.get_by_text(HOSTILE).count() >= 2
        buttons = page.locator("button[data-replay]")
        assert buttons.count() >= 2
        buttons.first.click()
        frame = page.frame_locator("iframe").first
        frame.locator("html[data-ready]").wait_for(state="attached")
        assert frame.locator("body").evaluate("window.replay.app.players[1].name") == HOSTILE
        frame.locator("#play").click()
        page.wait_for_timeout(600)
        assert frame.locator("body").evaluate("window.replay.app.position") >= 1
        for where in (page.locator("body"), frame.locator("body")):
            assert where.evaluate("window.ran") is None
        assert page.locator("body").evaluate("document.querySelector('iframe').contentDocument") is None
        assert buttons.first.inner_text() == "Close"
        buttons.first.press("Enter")
        page.locator("iframe").wait_for(state="detached")
        assert buttons.first.inner_text() == "Play"


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
def test_on_a_phone_in_light_and_dark(written: Path, dark: bool) -> None:
    with chromium() as browser, opened(browser, written, size=(390, 844), dark=dark, touch=True) as page:
        wide = page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
        assert wide[0] <= wide[1] == 390
        paper, ink = (DARK[PAPER], DARK[INK]) if dark else (PAPER, INK)
        assert page.evaluate("getComputedStyle(document.body).backgroundColor") == rgb(paper)
        text = page.locator("svg text").first
        assert text.evaluate("(node) => getComputedStyle(node).fill") == rgb(ink)
        first = page.locator("tbody th").first.bounding_box()
        assert first is not None
        assert first["width"] > 80
        button = page.locator("button[data-replay]").first
        button.tap()
        page.frame_locator("iframe").first.locator("html[data-ready]").wait_for(state="attached")
        frame = page.locator("iframe").bounding_box()
        assert frame is not None
        assert frame["width"] > 350
        assert frame["x"] + frame["width"] <= 390
