"""The page in a real browser; skipped without one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from PIL import Image
from tests.support.browser import chromium, opened, until
from tests.support.replays import short

from posse.rendering.style import GROUND, TARGET
from posse_training.replay import read_replay, record, write_replay
from posse_training.replay.page import command, verdict

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as started:
        yield started


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_replay(short(), tmp_path_factory.mktemp("replay") / "a replay.html")


def state(page: Page, what: str) -> Any:
    return page.evaluate(f"window.replay.app.{what}")


def drawn(page: Page, path: Path) -> Any:
    """Return the first picture's pixels, (H, W, 3)."""
    page.wait_for_timeout(80)
    page.locator("#views canvas").first.screenshot(path=path)
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB")).astype(int)


def test_every_number_of_a_replay_reaches_the_page(browser: Browser, written: Path) -> None:
    with opened(browser, written, "#t=0") as page:
        for k, player in enumerate(read_replay(written).players):
            assert state(page, f"players[{k}].name") == player.name
            for name, values in player.columns.items():
                found = page.evaluate(
                    """([k, name, frames]) => {
                        const column = window.replay.app.players[k].columns.get(name);
                        const row = frame => Array.from({ length: column.size }, (_, i) => column.at(frame, i));
                        return Array.from({ length: frames }, (_, frame) => row(frame));
                    }""",
                    [k, name, player.frames],
                )
                wanted = values.reshape(player.frames, -1)
                np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9, err_msg=name)


def test_it_plays_to_the_end_and_pauses(browser: Browser, written: Path) -> None:
    with opened(browser, written, "#t=0") as page:
        page.keyboard.press("Space")
        until(page, "window.replay.app.position >= 1")
        page.keyboard.press("Space")
        there = state(page, "position")
        assert 1 <= there < 40
        assert there == int(there)
        assert not state(page, "playing")
        page.select_option("#speed", "8")
        page.click("#play")
        until(page, "window.replay.app.position === window.replay.app.last")
        until(page, "!window.replay.app.playing")
        page.select_option("#speed", "1")  # else it may be over before one looks
        page.click("#play")  # at the end it starts over
        until(page, "window.replay.app.position < 100 && window.replay.app.playing")


@pytest.mark.parametrize("size", [(1300, 800), (390, 844)])
def test_the_head_says_what_happened_what_one_sees_and_how_to_make_it_again(
    browser: Browser, written: Path, size: tuple[int, int]
) -> None:
    replay = read_replay(written)
    with opened(browser, written, "#t=0", size=size) as page:
        assert page.locator("#verdict").inner_text() == verdict(replay)
        assert page.locator("#made code").inner_text() == command(replay)
        for part in ("#verdict", "#seen", "#made a"):
            box = page.locator(part).bounding_box()
            assert box is not None
            assert 0 <= box["x"] < box["x"] + box["width"] <= size[0]


def test_where_poses_drift_each_tracker_has_a_ghost_in_the_pose_that_it_believes(
    browser: Browser, tmp_path: Path
) -> None:
    replay = record(["idle"], "robots", odometry_drift=0.4, seconds=20, observations=False)
    believed = [replay.players[0].columns[f"believed_{k}"][200] for k in "xy"]
    with opened(browser, write_replay(replay, tmp_path / "a.html"), "#t=20") as page:
        page.locator("#views canvas").hover()
        page.mouse.wheel(0, 300)  # so that all are in view
        page.evaluate("window.replay.set({ layers: {} })")
        picture = drawn(page, tmp_path / "view.png")
        for x, y in np.transpose(believed).tolist():
            x, y = page.evaluate(f"window.replay.look(0).project({x}, {y})")
            assert np.abs(picture[round(y), round(x)] - GROUND).max() > 10


def test_keys_seek_and_the_picture_follows_the_data(browser: Browser, written: Path, tmp_path: Path) -> None:
    player = read_replay(written).players[0]
    with opened(browser, written, "#t=0") as page:
        for keys, frame in (
            (["ArrowRight"], 1),
            (["Shift+ArrowRight"], 11),
            (["ArrowLeft"], 10),
            (["End"], 200),
            (["Home"], 0),
            (["Shift+ArrowRight"] * 9, 90),
        ):
            for key in keys:
                page.keyboard.press(key)
            assert state(page, "position") == frame
        page.keyboard.press("t")
        look = "window.replay.look(0).project"
        for frame in (0, 90, 200):
            page.evaluate(f"window.replay.set({{ position: {frame} }})")
            picture = drawn(page, tmp_path / "view.png")
            place = [float(player.columns[f"target_{k}"][frame]) for k in ("x", "y")]
            rows, columns = np.nonzero(np.abs(picture - TARGET).max(axis=-1) <= 6)
            assert len(rows) > 20
            wanted = page.evaluate(f"{look}({place[0]}, {place[1]})")
            assert np.abs(np.subtract((columns.mean(), rows.mean()), wanted)).max() < 8


def test_the_timeline_jumps_and_ticks_select(browser: Browser, written: Path) -> None:
    player = read_replay(written).players[0]
    event = next(e for e in player.events if e.robots)
    with opened(browser, written, "#t=0") as page:
        box = page.locator("#timeline").bounding_box()
        assert box is not None
        left, width = box["x"] + 58, box["width"] - 58 - 14
        page.mouse.click(left + width / 2, box["y"] + 60)
        assert abs(state(page, "position") - 100) <= 1
        page.mouse.down()
        page.mouse.move(left + width / 4, box["y"] + 60)
        page.mouse.up()
        assert abs(state(page, "position") - 50) <= 1
        page.mouse.click(left + width * event.step / 200, box["y"] + 9)
        assert state(page, "position") == event.step
        assert state(page, "selected") in event.robots
        steps = sorted({e.step for p in read_replay(written).players for e in p.events})
        page.keyboard.press("Home")
        page.keyboard.press("n")
        assert state(page, "position") == next(step for step in steps if step > 0)


def test_selecting_a_robot_shows_its_numbers(browser: Browser, written: Path) -> None:
    replay = read_replay(written)
    with opened(browser, written, "#t=0") as page:
        page.evaluate("window.replay.set({ position: 60 })")
        x, y = (float(replay.players[0].columns[f"tracker_{k}"][60, 2]) for k in "xy")
        place = page.evaluate(f"window.replay.look(0).project({x}, {y})")
        page.locator("#views canvas").first.click(position={"x": place[0], "y": place[1]})
        assert state(page, "selected") == 2
        assert page.locator("#panel h2").inner_text().startswith("tracker 2")
        for block in ("own motion", "task", "target", "sonar", "team-mates"):
            assert page.locator("summary", has_text=f"observed: {block}").count() == 1
        row = page.locator("tr", has=page.locator("th", has_text="target range"))
        cells = row.locator("td").all_inner_texts()
        assert cells[0] == "m"
        for cell, player in zip(cells[1:], replay.players, strict=True):
            told = player.columns["observation/target_range"][60, 2]
            assert cell == ("not known" if told == -1 else f"{told:.2f}")
        page.keyboard.press("3")
        assert page.locator("#panel h2").inner_text().startswith("tracker 3")
        page.keyboard.press("Escape")
        assert state(page, "selected") is None
        assert "No robot selected" in page.locator("#panel").inner_text()


def test_the_safe_score_stops_at_the_first_contact(browser: Browser, tmp_path: Path) -> None:
    replay = record(["pursuit", "idle"], "obstacles", world=3, seconds=30, observations=False)
    scores = [player.columns["score"] for player in replay.players]
    contacts = ([event.step for event in player.events if event.kind == "contact"] for player in replay.players)
    touches = [min(steps, default=10**6) for steps in contacts]
    assert touches[0] < 300 < touches[1]
    with opened(browser, write_replay(replay, tmp_path / "a.html"), "#t=28") as page:
        for name, kept in (("score so far", [10**6] * 2), ("safe score so far", touches)):
            row = page.locator("tr", has=page.get_by_text(name, exact=True))
            wanted = [f"{score[: min(281, end)].sum() / 280:.3f}" for score, end in zip(scores, kept, strict=True)]
            assert row.locator("td").all_inner_texts()[1:] == wanted


def test_the_address_says_when_and_whom(browser: Browser, written: Path) -> None:
    with opened(browser, written, "#t=12.4&r=3") as page:
        assert (state(page, "position"), state(page, "selected")) == (124, 3)
        assert page.locator("#clock").inner_text() == "12.4 / 20.0 s"
        page.evaluate("location.hash = '#t=0.3&r=1'")
        until(page, "window.replay.app.position === 3")
        assert state(page, "selected") == 1
        page.keyboard.press("ArrowRight")
        until(page, "location.hash === '#t=0.4&r=1'")
        page.evaluate("location.hash = '#t=0.5'; history.replaceState(null, '', '#t=0.4&r=1')")  # as the page does
        until(page, "window.replay.app.position === 5")
        page.evaluate("location.hash = '#t=nonsense&r=99'")
        until(page, "window.replay.app.selected === null")
        assert state(page, "position") == 5
