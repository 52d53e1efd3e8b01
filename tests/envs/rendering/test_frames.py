"""Frames: what is drawn where, and that equal states give equal frames."""

import numpy as np
import numpy.typing as npt
import pytest
from tests.support.process import printed

import posse
from posse.rendering.renderer import Renderer
from posse.rendering.style import GROUND, SENSING, SLOT_FILLED, TARGET, TRACKER

Frame = npt.NDArray[np.uint8]
SIZE = (400, 360)


def frame_of(renderer: Renderer, batch: posse.Batch) -> Frame:
    frame = renderer.draw(batch)
    assert frame is not None
    return frame


def assert_colour(renderer: Renderer, frame: Frame, place: npt.ArrayLike, colour: tuple[int, int, int]) -> None:
    column, row = renderer.camera.project(place).round().astype(int)
    np.testing.assert_allclose(frame[row, column].astype(int), colour, rtol=0, atol=4)


@pytest.mark.parametrize("scenario", posse.scenario_names())
def test_frames_change_when_robots_move_and_never_change_the_world(scenario: str) -> None:
    batch = posse.batch(scenario, 1, seed=3)
    batch.reset()
    renderer, followed = (Renderer(batch.scenario, size=SIZE) for _ in range(2))
    first = frame_of(renderer, batch)
    followed.follow(batch)
    kept, before = first.copy(), {name: values.copy() for name, values in batch.state.items()}
    assert first.shape == (360, 400, 3)
    np.testing.assert_array_equal(first, frame_of(renderer, batch), "the same moment looks the same")
    np.testing.assert_equal({**batch.state}, before)
    saved = batch.save()
    for _ in range(3):
        batch.step(np.full(batch.action_shape, 0.25, np.float32))
    assert (frame_of(renderer, batch) != first).any()
    np.testing.assert_array_equal(first, kept, "frames are not overwritten")
    np.testing.assert_array_equal(frame_of(renderer, batch), frame_of(followed, batch), "also where one was left out")
    batch.restore(saved)
    np.testing.assert_array_equal(first, frame_of(renderer, batch), "trails end where the world goes back")


def test_robots_and_slots_are_drawn_where_they_are() -> None:
    batch = posse.batch("constant", 1, num_trackers=2)
    poses = [(5, 0, 1.57), (-1.2, 0, 0)]  # the second in the wedge's first slot, 1.2 m behind the target
    batch.reset(options={"tracker_pose": poses, "target_pose": (0, 0, 0)})
    renderer = Renderer(batch.scenario, size=(900, 800))
    frame = renderer.draw(batch, colours=[TRACKER, (0, 0, 255)])
    assert frame is not None
    assert_colour(renderer, frame, (5.07, -0.07), TRACKER)
    assert_colour(renderer, frame, (-1.22, 0.06), (0, 0, 255))
    assert_colour(renderer, frame, (-0.05, 0.05), TARGET)
    assert_colour(renderer, frame, (-1.2, 0.225), SLOT_FILLED)
    assert_colour(renderer, frame, (2, 1), GROUND)


def test_what_lies_behind_an_obstacle_is_not_in_sight() -> None:
    batch = posse.batch("obstacles", 1, num_trackers=1, num_obstacles=1, sensing_range=5.0)
    batch.reset(options={"tracker_pose": [(0, 0, 0)], "target_pose": (0, 4, 0)})
    (obstacle,) = batch.arrays.obstacle[0]
    obstacle["x"], obstacle["y"], obstacle["radius"] = 2.0, 0.0, 0.5
    with pytest.raises(ValueError, match=r"scale=0\.0 must be"):
        Renderer(batch.scenario, scale=0.0)
    renderer = Renderer(batch.scenario)
    frame = frame_of(renderer, batch)
    assert_colour(renderer, frame, (1.2, 0.2), SENSING)
    assert_colour(renderer, frame, (3.2, 0.2), GROUND)


def test_sight_without_limit_is_drawn_like_one_beyond_the_view() -> None:
    frames = []
    for sensing_range in (np.inf, 50.0):
        batch = posse.batch("constant", 1, field_of_view=1.0, sensing_range=sensing_range)
        batch.reset()
        frames.append(frame_of(Renderer(batch.scenario, size=SIZE), batch))
    np.testing.assert_array_equal(frames[0], frames[1])


def test_frames_need_no_display_and_importing_posse_no_pygame() -> None:
    code = (
        "import sys, posse; print('pygame' in sys.modules);"
        "from posse.rendering.renderer import Renderer; import pygame; b = posse.batch('constant'); b.reset();"
        "print(Renderer(b.scenario).draw(b).shape, pygame.display.get_init());"
        "pygame.quit(); Renderer(b.scenario).draw(b)"  # as other environments do when they are closed
    )
    assert printed("-c", code).split() == ["False", "(640,", "640,", "3)", "False"]
