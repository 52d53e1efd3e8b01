"""``posse demo``, ``posse watch`` and ``posse play`` at the keys of a window without a screen, and films."""

import re
import webbrowser
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pygame
import pytest
from PIL import Image

from posse.rendering.canvas import Window
from posse.rendering.style import TARGET
from posse_baselines import load
from posse_training import demo
from posse_training.cli import main
from posse_training.evaluation import evaluate
from posse_training.film import film
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


Frames = npt.NDArray[np.uint8]
PURSUIT, IDLE = ("one", load("pursuit")), ("two", load("idle"))


def read(path: Path) -> tuple[Frames, list[float]]:
    """The frames (K, H, W, 3) of a GIF, and how long each is shown, ms."""
    frames, times = [], []
    with Image.open(path) as image:
        for k in range(getattr(image, "n_frames", 1)):
            image.seek(k)
            frames.append(np.asarray(image.convert("RGB")))
            times.append(image.info["duration"])
    return np.stack(frames), times


def test_panels_stand_side_by_side_on_the_same_world(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "er" / "a.gif"
    assert film([PURSUIT, IDLE, PURSUIT], "smart", path=path, seed=3, seconds=2.0, size=200) == path
    frames, times = read(path)
    assert frames.shape == (21, 200, 600, 3)
    assert set(times[:-1]) == {70}  # 0.1 s at 1.5 times, in 1/100 s
    first, second, third = (frames[:, 20:, k : k + 196] for k in (2, 202, 402))
    np.testing.assert_array_equal(first, third)
    np.testing.assert_array_equal(first[0], second[0])
    assert (first[-1] != second[-1]).any()


def test_frames_may_be_left_out_and_a_film_may_begin_later(tmp_path: Path) -> None:
    settings: dict[str, Any] = {"seed": 3, "size": 200, "speed": 1.0}
    whole, times = read(film([PURSUIT], "smart", path=tmp_path / "a.gif", seconds=3.0, **settings))
    part, longer = read(film([PURSUIT], "smart", path=tmp_path / "b.gif", seconds=2.0, start=1.0, every=6, **settings))
    assert (len(whole), times[0], times[-1]) == (31, 100, 1500)
    assert (len(part), longer[0]) == (5, 600)
    np.testing.assert_array_equal(part, whole[[10, 16, 22, 28, 30]])
    film([PURSUIT], "smart", path=tmp_path / "c.gif", seconds=0.01, scores=True)
    with pytest.raises(ValueError, match=r"every=1\.5 must be a whole number"):
        film([PURSUIT], "smart", path=tmp_path / "c.gif", every=1.5)  # type: ignore[arg-type]


def test_an_mp4_has_the_frames_and_the_length_asked_for(tmp_path: Path) -> None:
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    path = film([PURSUIT], "smart", path=tmp_path / "a.mp4", seconds=2.0, size=301, speed=1.5)
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert frames == 21
    assert seconds == pytest.approx(21 / 15, abs=0.05)
    reader = imageio_ffmpeg.read_frames(str(path))
    assert next(reader)["size"] == (300, 300)  # H.264 needs even sides
    first = np.frombuffer(next(reader), np.uint8).reshape(300, 300, 3)
    reader.close()
    assert (np.abs(first.astype(int) - TARGET).max(axis=-1) < 40).sum() > 20
    assert list(tmp_path.iterdir()) == [path]


def test_a_film_ends_with_the_episode_and_has_curves_below(tmp_path: Path) -> None:
    settings: dict[str, Any] = {"horizon": 50, "settle_time": 1.0, "seconds": 60, "every": 10, "size": 200}
    frames, _ = read(film([PURSUIT], "constant", path=tmp_path / "a.gif", scores=True, **settings))
    assert frames.shape == (6, 300, 200, 3)
    drawn = [(np.abs(frame[200:].astype(int) - (0, 114, 178)).max(axis=-1) <= 30).sum() for frame in frames]
    assert drawn == sorted(drawn)
    assert drawn[-1] > drawn[0] + 50
