"""Pictures stay legible: robots of a size one can see, no hairball of links, all explained."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import posse
from posse.rendering import layers
from posse.rendering.camera import Camera
from posse.rendering.canvas import Canvas, pixels
from posse.rendering.content.history import History
from posse.rendering.content.scene import Scene, read_scene
from posse.rendering.content.view import View
from posse.rendering.key import UNEXPLAINED, legend_of
from posse.rendering.legend import tasks_of
from posse.rendering.picture import LAYERS, action_of, draw_world
from posse.rendering.style import GROUND, LINK, TARGET, TASK_COLOURS, TRACKER

Frame = npt.NDArray[np.uint8]
BOX = (0, 0, 640, 480)


def scene_of(scenario: str, steps: int = 0, told: Any = None, **settings: Any) -> Scene:
    batch = posse.batch(scenario, 1, seed=5, **settings)
    seen = batch.reset()
    for _ in range(steps):
        seen, *_ = batch.step(np.full(batch.action_shape, 0.3, np.float32))
    return read_scene(batch, 0, told, seen)


def drawn(scene: Scene, view: View, box: tuple[int, int, int, int] = BOX) -> tuple[Frame, Camera]:
    camera = Camera(box, scene.scenario.arena, whole=False)
    camera.follow(action_of(scene), 0.0)
    canvas, history = Canvas(box[2:]), History()
    history.note(scene)
    canvas.fill(GROUND)
    draw_world(canvas, camera, scene, history, 1.0, view)
    return pixels(canvas.finish()), camera


def count(frame: Frame, colour: tuple[int, int, int], off: int = 3) -> int:
    return int((np.abs(frame.astype(int) - colour).max(axis=-1) <= off).sum())


@pytest.mark.parametrize("box", [BOX, (0, 0, 1280, 720), (0, 0, 300, 220)])
@pytest.mark.parametrize(
    ("scenario", "settings"),
    [
        ("smart", {}),
        ("field", {"num_trackers": 12, "formation": "ring"}),
        ("field", {"num_trackers": 40, "formation": "rows"}),
        ("constant", {"num_trackers": 40, "formation": "rows", "start_distance": (4.0, 14.0)}),
    ],
)
def test_all_robots_are_in_view_and_large_enough(
    scenario: str, settings: dict[str, Any], box: tuple[int, int, int, int]
) -> None:
    scene = scene_of(scenario, 20, **settings)
    frame, camera = drawn(scene, View(sensing=False, links=False, trails=False), box)
    robots = np.vstack([scene.position[~scene.broken], scene.target])
    places = camera.project(robots)
    assert (places > 0).all()
    assert (places < box[2:]).all()
    for x, y in places:
        column, row = round(x), round(y)
        # Within the least radius nothing of the ground is seen.
        radius = layers.LEAST_RADIUS - 1.5
        for angle in np.linspace(0, 2 * math.pi, 8, endpoint=False):
            at = round(row + radius * math.sin(angle)), round(column + radius * math.cos(angle))
            if 0 <= at[0] < box[3] and 0 <= at[1] < box[2]:
                assert np.abs(frame[at].astype(int) - GROUND).max() > 12
    assert count(frame, TARGET) > 20


def test_the_camera_in_an_arena_comes_closer_than_the_arena() -> None:
    # Near a wall, one beside the other: the view holds them, and hardly anything outside.
    camera = Camera(BOX, 24.0, whole=False)
    points = np.array([[9.0, 9.0], [11.0, 10.5]])
    camera.follow(points, 0.0)
    whole = Camera(BOX, 24.0)
    assert camera.scale > 2 * whole.scale
    low, high = camera.bounds()
    assert (low < points.min(axis=0)).all()
    assert (high > points.max(axis=0)).all()
    assert (high <= 12.8).all()
    # And never farther away than the arena needs.
    camera.reset()
    camera.follow(np.array([[-12.0, -12.0], [12.0, 12.0]]), 0.0)
    assert camera.scale == pytest.approx(whole.scale)


def test_pixels_and_points_are_inverse() -> None:
    camera = Camera((10, 20, 400, 300), math.inf)
    camera.look((3.0, -2.0), 37.0)
    points = np.array([[1.0, 2.0], [-4.0, 0.5]])
    np.testing.assert_allclose(camera.unproject(camera.project(points)), points)


def test_a_large_team_shows_links_of_the_selected_tracker_only() -> None:
    scene = scene_of("field", 30, num_trackers=40, formation="rows")
    assert (scene.links > 0).sum() > 200
    plain = View(sensing=False, trails=False)

    def linked(selected: int | None) -> int:
        views = (View(selected, sensing=False, trails=False, links=k) for k in (True, False))
        with_links, without = (drawn(scene, view)[0] for view in views)
        return int((with_links != without).any(axis=-1).sum())

    assert linked(None) == 0
    assert 0 < linked(7) < 0.05 * BOX[2] * BOX[3]
    assert count(drawn(scene, plain)[0], LINK) == 0


def test_the_selected_tracker_shows_its_last_fix_where_that_was() -> None:
    batch = posse.batch("radio", 1, seed=5, num_trackers=1, sensing_range=4.0)
    batch.reset(options={"tracker_pose": [[0, 0, 0]], "target_pose": [3, 0, 0]})
    for _ in range(60):
        batch.step(np.full(batch.action_shape, -1, np.float32))
    scene = read_scene(batch)
    assert scene.knowledge.fix_age[0] > 0.5
    assert math.dist(scene.knowledge.fix[0], scene.target) > 0.3
    frames = [drawn(scene, View(chosen, sensing=False))[0] for chosen in (None, 0)]
    camera = drawn(scene, View())[1]
    column, row = camera.project(scene.knowledge.fix[0]).round().astype(int)
    changed = (frames[0] != frames[1]).any(axis=-1)
    assert changed[row - 14 : row + 15, column - 14 : column + 15].sum() > 30


def test_everything_drawn_is_explained() -> None:
    told = {
        "task": [[0, 1, 2]],
        "leader": [[1, 1, 1]],
        "slot": [[0, 1, 2]],
        "estimate": np.zeros((1, 3, 3), np.float32),
    }
    scene = scene_of("field", 2, told, num_trackers=3)
    entries = legend_of(scene)
    assert {entry.layer for entry in entries} == set(LAYERS) - set(UNEXPLAINED)
    assert len({entry.text for entry in entries}) == len(entries)
    # Every sample draws something, and inside its place.
    for entry in entries:
        canvas = Canvas((60, 40))
        canvas.fill(GROUND)
        entry.sample(canvas, 30, 20, 1.0)
        off = np.abs(pixels(canvas.finish()).astype(int) - GROUND).max(axis=-1)
        rows, columns = np.nonzero(off > 4)
        assert len(rows) > 5, entry.text
        assert 8 < rows.min() <= rows.max() < 32, entry.text
        assert 12 <= columns.min() <= columns.max() <= 48, entry.text


def test_a_team_without_a_leader_has_none_in_its_legend() -> None:
    told: dict[str, Any] = {"task": [[0, 1, 2, 1, 1]]}
    leaderless = scene_of("smart", 0, told)
    led = scene_of("smart", 0, told | {"leader": [[1, 1, 1, 1, 1]]})
    assert [name for name, _ in tasks_of(leaderless)] == ["searching", "converging", "flocking"]
    assert not any("leader" in entry.text for entry in legend_of(leaderless))
    assert any("leader" in entry.text for entry in legend_of(led))
    assert tasks_of(led)[-1] == ("leader exchange", TASK_COLOURS[3])


def test_numbers_are_written_on_robots_that_are_large_enough() -> None:
    scene = scene_of("smart", 3)
    for least, differs in ((8.0, True), (4.0, False)):
        frames = [drawn(scene, View(numbers=numbers, least_robot=least, trails=False))[0] for numbers in (True, False)]
        assert (frames[0] != frames[1]).any() == differs
    assert count(frames[1], TRACKER) > 0
