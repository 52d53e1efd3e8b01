"""``posse demo``, and ``posse watch`` and ``posse play`` at the keys of a window without a screen."""

import re
import webbrowser
from collections.abc import Callable, Mapping
from pathlib import Path

import pygame
import pytest
from PIL import Image

from posse.rendering.canvas import Window
from posse_training import demo
from posse_training.cli import main
from posse_training.evaluation import evaluate
from posse_training.replay import read_replay

At = Callable[[Mapping[int, str]], list[str]]


@pytest.fixture
def at(monkeypatch: pytest.MonkeyPatch) -> At:
    """Types keys, separated by spaces, when a frame of a number is shown, without waiting for real time."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    show, count = Window.show, [0]

    def plan(keys: Mapping[int, str]) -> list[str]:
        states: list[str] = []

        def showing(window: Window, frame: pygame.Surface) -> bool:
            window._rate = 1000.0
            states.append("paused" if window.paused else "running")
            for key in keys.get(count[0], "").split():
                pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=pygame.key.key_code(key)))
            count[0] += 1
            assert count[0] <= max(keys) + 1, "the last key closes the window"
            return show(window, frame)

        def always(window: Window) -> bool:
            window.pressed.clear()
            window._due += 1
            return True

        monkeypatch.setattr(Window, "show", showing)
        monkeypatch.setattr(Window, "begin", always)
        return states

    return plan


def test_watching_steps_to_the_next_world_and_policy(at: At, capsys: pytest.CaptureFixture[str]) -> None:
    states = at({5: "space s", 6: "s", 7: "n", 8: "space", 12: "p", 20: "q"})
    assert main(["watch", "idle", "pursuit", "--scenario", "constant", "--size", "300", "300"]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert [line.partition(":")[0] for line in shown] == ["world 0, idle", "world 1, idle", "world 1, pursuit"]
    assert [line.rpartition(" after ")[2] for line in shown] == ["0.7 s", "0.4 s", "0.7 s"]
    assert states[5:10] == ["running", "paused", "paused", "paused", "running"]
    assert not pygame.display.get_init()


def test_a_page_is_recorded_and_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    assert main(["watch", "idle", "pursuit", "--page", "--seconds", "1"]) == 0
    page = tmp_path / "runs" / "watch" / "replay.html"
    assert opened == [page.as_uri()]
    assert [player.name for player in read_replay(page).players] == ["idle", "pursuit"]
    assert "open it in a browser" in capsys.readouterr().out


@pytest.mark.parametrize(("robot", "row"), [("target", 5), ("tracker_2", 2)])
def test_the_arrows_drive_a_robot_and_the_last_round_is_recorded(
    robot: str, row: int, at: At, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "mine.html"
    states = at({0: "space", 2: "n", 3: "space", 5: "left down", 6: "right", 9: "q"})
    assert main(["play", "pursuit", "--as", robot, "--out", str(out), "--size", "300", "300"]) == 0
    assert states[:5] == ["paused", "running", "running", "paused", "running"]
    assert "replay: " in capsys.readouterr().out
    player = read_replay(out).players[0]
    assert player.frames == 7
    speed, turn = player.columns["action"][:, row, :2].astype(float)[:6].T
    assert turn.tolist() == pytest.approx([0, 0, 1, -1, 0, 0], abs=1e-3)
    assert speed.tolist() == pytest.approx([1, 1, 0.8, 0.8, 0.8, 0.8], abs=1e-3)


def test_the_demo_prints_a_line_for_each_team_then_the_replay_and_the_film(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    teams = {"script": "ddcs-tuned", "learned": "learned-smart", "planner": "pursuit"}
    monkeypatch.setattr(demo, "TEAMS", teams)
    assert main(["demo", "--episodes", "10", "--seconds", "0.5", "--out", "shown"]) == 0
    lines = capsys.readouterr().out.strip().splitlines()
    for (kind, name), line, worlds in zip(teams.items(), lines, (10, 10, 2), strict=False):
        held = evaluate(name, "smart", worlds, 7, progress=False)["safe_score"].mean()
        assert re.fullmatch(rf"{kind} +{name} +held {100 * held:.0f} ± \d+ % of its slots in {worlds} worlds", line)
    assert lines[4].startswith("replay: shown/replay.html")
    assert lines[5] == "film:   shown/smart.gif"
    assert [player.name for player in read_replay("shown/replay.html").players] == ["ddcs-tuned", "learned-smart"]
    with Image.open("shown/smart.gif") as film:
        assert film.size == (800, 525)
