"""A film shows each policy on the same world, in colours that are right."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

import posse
from posse.rendering.renderer import Renderer
from posse.rendering.style import TARGET, TASK_COLOURS
from posse_baselines import load
from posse_training.errors import MissingExtraError, SettingsError
from posse_training.reports.pictures.film import film
from posse_training.reports.pictures.gif import write_gif
from posse_training.reports.pictures.mp4 import write_mp4

Frames = npt.NDArray[np.uint8]


def read(path: Path) -> tuple[Frames, list[float]]:
    """The frames (K, H, W, 3) of a GIF, and how long each is shown, ms."""
    frames, times = [], []
    with Image.open(path) as image:
        for k in range(getattr(image, "n_frames", 1)):
            image.seek(k)
            frames.append(np.asarray(image.convert("RGB")))
            times.append(image.info["duration"])
    return np.stack(frames), times


def test_what_is_written_is_what_was_drawn(tmp_path: Path) -> None:
    batch = posse.batch("field", 1, seed=1)
    batch.reset()
    renderer = Renderer(batch.scenario, size=(300, 300))
    drawn = []
    for _ in range(20):
        frame = renderer.draw(batch)
        assert frame is not None
        drawn.append(frame)
        batch.step(np.full(batch.action_shape, 0.3, np.float32))
    write_gif(tmp_path / "a.gif", drawn, 0.07)
    frames, times = read(tmp_path / "a.gif")
    with Image.open(tmp_path / "a.gif") as image:
        colours = len(image.getpalette() or []) // 3
        assert image.info["transparency"] < colours, "strict readers refuse one beyond the table"
    assert frames.shape == (20, 300, 300, 3)
    assert set(times[:-1]) == {70}
    assert times[-1] > 1000
    off = np.abs(frames.astype(int) - np.stack(drawn)).max(axis=-1)
    assert (off <= 4).mean() > 0.99  # flat colours stay; blends at edges share a palette
    # The few pixels of the target keep their colour as the wide ground does.
    target = np.abs(np.stack(drawn).astype(int) - TARGET).max(axis=-1) <= 3
    assert target.sum() > 10 * 20
    assert off[target].max() <= 4


def test_panels_stand_side_by_side_on_the_same_world(tmp_path: Path) -> None:
    policies = [("one", load("pursuit")), ("two", load("idle")), ("one", load("pursuit"))]
    settings: dict[str, Any] = {"seed": 3, "seconds": 2.0, "size": 200}
    path = film(policies, "smart", path=tmp_path / "deep" / "er" / "a.gif", **settings)
    frames, _ = read(path)
    assert frames.shape[1:] == (200, 604, 3)
    assert len(frames) == 21
    first, second, third = (frames[:, :, k : k + 200] for k in (0, 202, 404))
    np.testing.assert_array_equal(first, third)
    # Below the labels, the first frames are equal; later ones differ.
    assert (np.abs(first[0].astype(int) - second[0])[30:] <= 8).all()
    assert (first[-1] != second[-1]).any()


def test_frames_left_out_make_a_shorter_film_of_the_same_time(tmp_path: Path) -> None:
    policies = [("a", load("pursuit"))]
    settings: dict[str, Any] = {"seed": 3, "seconds": 2.0, "size": 200, "speed": 1.0}
    whole, times = read(film(policies, "smart", path=tmp_path / "a.gif", **settings))
    part, longer = read(film(policies, "smart", path=tmp_path / "b.gif", every=5, **settings))
    assert (len(whole), times[0]) == (21, 100)
    assert (len(part), longer[0]) == (5, 500)
    # Frames that were not drawn were still simulated: both end with the same picture.
    assert (np.abs(whole[-1].astype(int) - part[-1]) <= 24).mean() > 0.99


def test_a_film_ends_with_the_episode(tmp_path: Path) -> None:
    path = film(
        [("a", load("idle"))],
        "constant",
        path=tmp_path / "a.gif",
        horizon=50,
        settle_time=1.0,
        seconds=60,
        every=10,
        size=200,
    )
    assert len(read(path)[0]) == 6


def test_a_film_may_begin_later(tmp_path: Path) -> None:
    policies = [("a", load("pursuit"))]
    settings: dict[str, Any] = {"seed": 3, "size": 200, "speed": 1.0}
    whole, _ = read(film(policies, "smart", path=tmp_path / "a.gif", seconds=3.0, **settings))
    later, _ = read(film(policies, "smart", path=tmp_path / "b.gif", start=2.0, seconds=1.0, **settings))
    assert (len(whole), len(later)) == (31, 11)
    for k in (0, 5, 10):  # each has a palette of its own
        assert (np.abs(whole[20 + k].astype(int) - later[k]) <= 24).mean() > 0.99


def test_the_speed_is_written_in_the_film(tmp_path: Path) -> None:
    settings: dict[str, Any] = {"seed": 3, "seconds": 0.3, "size": 560}
    policies = [("a", load("idle"))]
    made = []
    for speed in (1.0, 4.0):
        path = film(policies, "smart", path=tmp_path / f"{speed}.gif", speed=speed, **settings)
        made.append(read(path)[0][0].astype(int))
    differs = np.abs(made[0] - made[1]).max(axis=-1) > 40
    rows, columns = np.nonzero(differs)
    inside = (rows > 35) & (rows < 60) & (columns < 40)  # below the header, on the left
    assert inside.sum() > 10
    assert inside.mean() > 0.9  # each film has a palette of its own


def test_one_camera_shows_every_panel_on_one_scale(tmp_path: Path) -> None:
    # The grid lies at the same pixels of both panels, though the teams are elsewhere.
    policies = [("one", load("pursuit")), ("two", load("idle"))]
    path = film(policies, "smart", path=tmp_path / "a.gif", seed=3, seconds=4.0, size=(702, 350))
    last = read(path)[0][-1]
    assert last.shape == (350, 702, 3)
    left, right = last[40:320, :350].astype(int), last[40:320, 352:].astype(int)
    assert (np.abs(left - right).max(axis=-1) <= 8).mean() > 0.95
    assert (np.abs(left - right).max(axis=-1) > 60).sum() > 50


@pytest.mark.parametrize(("policy", "leads"), [("ddcs-distributed", 0), ("ddcs-centralized", 1)])
def test_only_a_team_with_a_leader_has_one_in_its_film(policy: str, leads: int, tmp_path: Path) -> None:
    path = film([("a", load(policy))], "smart", path=tmp_path / "a.gif", seconds=0.3, size=560)
    footer = read(path)[0][-1][-26:].astype(int)
    exchange = np.abs(footer - TASK_COLOURS[3]).max(axis=-1) <= 6
    assert (exchange.sum() > 20) == leads
    searching = np.abs(footer - TASK_COLOURS[0]).max(axis=-1) <= 6
    assert searching.sum() > 20


def played(path: Path) -> tuple[Frames, float]:
    """The frames (K, H, W, 3) of an MP4, and how many there are in a second."""
    ffmpeg = pytest.importorskip("imageio_ffmpeg").get_ffmpeg_exe()
    about = subprocess.run([ffmpeg, "-i", str(path)], capture_output=True, text=True, check=False)
    found = re.search(r"Video: h264.* (\d+)x(\d+).* ([\d.]+) fps", about.stderr)
    assert found, about.stderr
    raw = subprocess.run(
        [ffmpeg, "-loglevel", "error", "-i", str(path), "-f", "rawvideo", "-pix_fmt", "rgb24", "-"],
        capture_output=True,
        check=True,
    ).stdout
    shape = (-1, int(found[2]), int(found[1]), 3)
    return np.frombuffer(raw, np.uint8).reshape(shape), float(found[3])


def test_an_mp4_holds_the_same_pictures(tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg")
    policies = [("a", load("pursuit"))]
    settings: dict[str, Any] = {"seed": 3, "seconds": 2.0, "size": 301, "speed": 1.5}
    gif, _ = read(film(policies, "smart", path=tmp_path / "a.gif", **settings))
    frames, rate = played(film(policies, "smart", path=tmp_path / "a.mp4", **settings))
    assert frames.shape == (21, 302, 302, 3)  # H.264 needs even sides
    assert rate == 15.0
    for k in (0, 10, 20):
        off = np.abs(frames[k, :301, :301].astype(int) - gif[k]).max(axis=-1)
        assert (off < 40).mean() > 0.98
    assert {path.name for path in tmp_path.iterdir()} == {"a.gif", "a.mp4"}


def test_an_mp4_of_slow_motion_repeats_its_frames(tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg")
    path = film([("a", load("idle"))], "smart", path=tmp_path / "a.mp4", seconds=1.0, speed=0.25, size=200)
    frames, rate = played(path)
    assert rate == 10.0
    assert len(frames) == 11 * 4


def test_what_ffmpeg_cannot_write_is_said_and_leaves_nothing(tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg")
    path = tmp_path / "missing" / "a.mp4"
    with pytest.raises(SettingsError, match=r"ffmpeg could not write .*a\.mp4: .*No such file"):
        write_mp4(path, [np.zeros((200, 200, 3), np.uint8)] * 50, 0.1)
    assert not list(tmp_path.iterdir())


def test_an_mp4_without_its_extra_says_how_to_install_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(MissingExtraError, match=r"pip install '\.\[video\]'"):
        film([("a", load("idle"))], "smart", path=tmp_path / "a.mp4", seconds=1.0)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"policies": []}, "No policies given"),
        ({"path": "film.avi"}, r"must end in \.gif or \.mp4"),
        ({"seconds": 0.0}, "seconds=0.0 must be"),
        ({"speed": float("nan")}, "speed=nan must be"),
        ({"every": 0}, "every=0 must be a whole number"),
        ({"size": 20}, "size=20 must be at least 200"),
        ({"size": (400, 100)}, r"size=\(400, 100\) must be at least 200"),
        ({"size": 5000}, "size=5000 makes a film of more than 4096 px"),
        ({"start": -1.0}, r"start=-1.0 \(--from\) must be a finite number, at least 0"),
        ({"size": (4000, 4000), "seconds": 60}, "is too large: make it shorter"),
        ({"start": 60.0}, r"start=60.0 \(--from\) must be below 60 s"),
        ({"scenario": "smrt"}, "unknown scenario 'smrt'"),
        ({"target_motion": "agent"}, "the target of 'smart' is an agent"),
    ],
)
def test_what_cannot_be_filmed_is_named(
    wrong: dict[str, Any], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    settings = {"policies": [("a", load("idle"))], "scenario": "smart", "path": "a.gif"} | wrong
    with pytest.raises(ValueError, match=message):
        film(**settings)
    assert not list(tmp_path.iterdir())
