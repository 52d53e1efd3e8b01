"""Frames: what is drawn where, and that equal states give equal frames."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.support.drawing import SIZE, advance, colour_at, count, like, picture, placed, worlds

import posse
from posse.rendering.camera import Camera
from posse.rendering.content.scene import read_scene
from posse.rendering.renderer import Renderer
from posse.rendering.style import SLOT_FILLED, TARGET, TRACKER


@pytest.mark.parametrize("scenario", posse.scenario_names())
def test_every_scenario_is_drawn(scenario: str) -> None:
    batch = worlds(scenario)
    renderer = Renderer(batch.scenario, size=SIZE)
    for _ in range(3):
        frame = picture(renderer, batch)
        assert frame.dtype == np.uint8
        assert frame.shape == (360, 400, 3)
        assert count(frame, TARGET) > 20
        advance(batch)


@pytest.mark.parametrize("num_trackers", [1, 30])
def test_teams_of_any_size_are_drawn(num_trackers: int) -> None:
    batch = worlds(num_trackers=num_trackers, formation="rows", start_distance=(4.0, 14.0))
    renderer = Renderer(batch.scenario)
    assert count(picture(renderer, batch), TRACKER) > 20 * num_trackers


def test_the_same_states_give_the_same_frames() -> None:
    films = []
    for _ in range(2):
        batch = worlds("field")
        renderer = Renderer(batch.scenario, size=SIZE)
        frames = []
        for _ in range(12):
            frames.append(picture(renderer, batch))
            advance(batch)
        films.append(np.stack(frames))
    np.testing.assert_array_equal(films[0], films[1])
    assert (films[0][0] != films[0][-1]).any()


def test_a_moment_drawn_twice_looks_the_same() -> None:
    batch = worlds("smart")
    renderer = Renderer(batch.scenario, size=SIZE)
    for _ in range(5):
        first = picture(renderer, batch)
        np.testing.assert_array_equal(first, picture(renderer, batch))
        advance(batch, 3)


def test_moments_followed_count_as_if_drawn() -> None:
    drawn, followed = worlds("smart"), worlds("smart")
    every, some = Renderer(drawn.scenario, size=SIZE), Renderer(drawn.scenario, size=SIZE)
    for _ in range(25):
        picture(every, drawn)
        some.follow(followed)
        advance(drawn)
        advance(followed)
    np.testing.assert_array_equal(picture(every, drawn), picture(some, followed))


def test_a_new_episode_starts_from_a_clean_picture() -> None:
    batch = worlds("smart")
    used = Renderer(batch.scenario, size=SIZE)
    for _ in range(30):
        picture(used, batch)
        advance(batch)
    batch.reset()
    advance(batch, 40)  # later than anything that was drawn of the episode before
    fresh = Renderer(batch.scenario, size=SIZE)
    np.testing.assert_array_equal(picture(used, batch), picture(fresh, batch))


def test_going_back_in_time_starts_from_a_clean_picture() -> None:
    batch = worlds("smart")
    snapshot = batch.save()
    used = Renderer(batch.scenario, size=SIZE)
    for _ in range(30):
        picture(used, batch)
        advance(batch)
    batch.restore(snapshot)
    fresh = Renderer(batch.scenario, size=SIZE)
    np.testing.assert_array_equal(picture(used, batch), picture(fresh, batch))


@pytest.mark.parametrize("scenario", ["smart", "field", "radio"])
def test_drawing_leaves_the_worlds_alone(scenario: str) -> None:
    drawn, other = worlds(scenario, message_size=2), worlds(scenario, message_size=2)
    renderer = Renderer(drawn.scenario, size=SIZE)
    for _ in range(4):
        picture(renderer, drawn)
        advance(drawn)
        advance(other)
    for name, values in drawn.state.items():
        np.testing.assert_array_equal(values, other.state[name], err_msg=name)


def test_frames_are_never_overwritten() -> None:
    batch = worlds()
    renderer = Renderer(batch.scenario, size=SIZE)
    first = picture(renderer, batch)
    kept = first.copy()
    advance(batch, 20)
    picture(renderer, batch)
    np.testing.assert_array_equal(first, kept)
    assert first.flags.writeable


def test_each_world_of_a_batch_is_its_own_picture() -> None:
    batch = worlds("smart", 3)
    alone = posse.batch("smart", 1, seed=3, first_world=2)
    alone.reset()
    of_many = picture(Renderer(batch.scenario, size=SIZE), batch, world=2)
    np.testing.assert_array_equal(of_many, picture(Renderer(alone.scenario, size=SIZE), alone))
    first = picture(Renderer(batch.scenario, size=SIZE), batch, world=0)
    assert (of_many != first).any()


def test_robots_are_drawn_where_they_are() -> None:
    # Up is +y, right is +x: tracker 0 lies right of the target, tracker 1 above it.
    batch = placed([(5, 0, 1.57), (0, 5, 3.0)])
    renderer = Renderer(batch.scenario, size=SIZE)
    frame = picture(renderer, batch)
    # Not at the centre, where the line of the heading begins.
    assert like(colour_at(renderer, frame, 5, -0.07), TRACKER)
    assert like(colour_at(renderer, frame, 0.07, 5), TRACKER)
    assert like(colour_at(renderer, frame, 0, 0), TARGET)
    right, above, centre = renderer.project([(5, 0), (0, 5), (0, 0)])
    assert right[0] > centre[0]
    assert right[1] == pytest.approx(centre[1])
    assert above[1] < centre[1]
    assert above[0] == pytest.approx(centre[0])


def test_a_robot_that_moves_changes_the_picture_where_it_was_and_is() -> None:
    frames = {}
    for x in (-4.0, -3.0):
        # The third tracker keeps the view in place.
        batch = placed([(x, 2, 0), (-6, -6, 0), (6, 6, 0)])
        renderer = Renderer(batch.scenario, size=SIZE)
        frames[x] = picture(renderer, batch)
    changed = (frames[-4.0] != frames[-3.0]).any(axis=-1)
    for x in (-4.0, -3.0):
        column, row = renderer.project([x, 2.0]).round().astype(int)
        assert changed[row - 1 : row + 2, column - 1 : column + 2].all()
    # And nowhere else: there is no more of a difference than two robots and their headings.
    rows, columns = np.nonzero(changed)
    metres = np.abs(np.stack([columns, rows], -1) - renderer.project([-3.5, 2.0]))
    assert metres.max() < renderer.project([1.1, 0])[0] - renderer.project([0, 0])[0]


def test_the_heading_is_drawn() -> None:
    ahead = np.zeros((2, 2))
    for k, heading in enumerate((0.0, math.pi / 2)):
        batch = placed([(4, 0, heading)])
        renderer = Renderer(batch.scenario, size=SIZE)
        frame = picture(renderer, batch)
        for j, direction in enumerate((0.0, math.pi / 2)):
            place = 4 + 0.2 * math.cos(direction), 0.2 * math.sin(direction)
            ahead[k, j] = sum(colour_at(renderer, frame, *place))
    assert (ahead.argmin(axis=1) == [0, 1]).all()  # the line is darker than the ground


@pytest.mark.parametrize("heading", [0.0, 2.0, -2.5])
def test_slots_are_filled_where_a_tracker_holds_them(heading: float) -> None:
    # In the middle of the wedge's first slot, 1.2 m straight behind the target.
    behind = (-1.2 * math.cos(heading), -1.2 * math.sin(heading), heading)
    batch = placed([behind, (5, 5, 0)], (0, 0, heading))
    renderer = Renderer(batch.scenario, size=SIZE)
    frame = picture(renderer, batch)
    scene = read_scene(batch)
    np.testing.assert_allclose(scene.slots[0], behind[:2], rtol=1e-5, atol=1e-4)
    np.testing.assert_array_equal(scene.occupied, [True, False])
    inside = scene.slots + 0.225 * np.array([-math.sin(heading), math.cos(heading)])
    assert like(colour_at(renderer, frame, *inside[0]), SLOT_FILLED)
    assert not like(colour_at(renderer, frame, *inside[1]), SLOT_FILLED)


def test_obstacles_and_walls_are_drawn_where_they_are() -> None:
    batch = worlds("obstacles")
    renderer = Renderer(batch.scenario)
    frame = picture(renderer, batch)
    for x, y, radius in read_scene(batch).obstacles:
        inside = sum(colour_at(renderer, frame, x, y))
        outside = sum(colour_at(renderer, frame, x + radius + 0.3, y + 0.17))
        assert inside < outside - 50
    half = batch.scenario.arena / 2
    for x, y in ((half, 0.3), (-half, 0.3), (0.3, half), (0.3, -half)):
        # A wall stands outside of where robots can be.
        outwards = 1.003
        assert sum(colour_at(renderer, frame, x * outwards, y * outwards)) < 600


def test_trails_show_where_a_tracker_was_and_fade() -> None:
    batch = placed([(-6, 3, 0), (6, 6, 0)])
    renderer = Renderer(batch.scenario, size=(640, 640))
    for _ in range(50):
        picture(renderer, batch)
        batch.step(np.array([[[1, 0], [-1, 0]]], np.float32))
    frame = picture(renderer, batch)
    x = float(batch.state["tracker_x"][0, 0])
    shades = [sum(colour_at(renderer, frame, x - back, 3)) for back in (0.5, 2.5, 4.5)]
    assert shades[0] < shades[1] < shades[2] < 3 * 248


def test_the_view_holds_every_working_robot_on_the_open_plane() -> None:
    batch = worlds("smart")
    renderer = Renderer(batch.scenario, size=SIZE)
    for _ in range(200):
        renderer.follow(batch)
        scene = read_scene(batch)
        place = renderer.project(np.vstack([scene.position, scene.target]))
        assert (place > (0, 0)).all()
        assert (place < SIZE).all()
        advance(batch)


def test_the_camera_moves_smoothly_and_settles() -> None:
    camera = Camera((0, 0, 400, 400), math.inf)
    points = np.array([[0.0, 0.0], [12.0, 5.0]])
    camera.follow(points, 0.0)
    start = camera.scale
    steps = []
    for _ in range(200):
        before = np.append(camera.centre, math.log(camera.scale))
        camera.follow(points / 2, 0.1)
        steps.append(np.abs(np.append(camera.centre, math.log(camera.scale)) - before).max())
    assert max(steps) < 0.5
    assert steps[-1] < 1e-6
    assert camera.scale > 1.5 * start
    # A little more or less of spread does not change the scale: no breathing.
    settled = camera.scale
    for wobble in (1.02, 0.98, 1.02):
        camera.follow(points / 2 * wobble, 0.1)
        assert camera.scale == pytest.approx(settled, rel=1e-6)
