"""A film shows each policy on the same world, in colours that are right."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from PIL import Image

import posse
from posse.rendering.renderer import Renderer
from posse.rendering.style import TARGET
from posse_baselines import load
from posse_training.reports.pictures.film import film
from posse_training.reports.pictures.gif import write_gif

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
        [("a", load("idle"))], "constant", path=tmp_path / "a.gif", horizon=50, settle_time=1.0,
        seconds=60, every=10, size=200,
    )  # fmt: skip
    assert len(read(path)[0]) == 6


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"policies": []}, "No policies given"),
        ({"path": "film.mp4"}, r"must end in \.gif"),
        ({"seconds": 0.0}, "seconds=0.0 must be"),
        ({"speed": float("nan")}, "speed=nan must be"),
        ({"every": 0}, "every=0 must be a whole number"),
        ({"size": 20}, "size=20 must be at least 200"),
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
