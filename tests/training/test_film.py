"""A film shows each policy on the same world."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

from posse.rendering.style import TARGET
from posse_baselines import load
from posse_training.film import film

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
