"""Frames: what is drawn where; the window of the mode "human": pause, one step, speed, close; in anybody's loop."""

import threading
from typing import Any

import numpy as np
import numpy.typing as npt
import pygame
import pytest
from tests.support.process import printed

import posse
from posse.rendering.canvas import Window
from posse.rendering.renderer import Renderer
from posse.rendering.style import GROUND, SENSING, SLOT_FILLED, TARGET, TRACKER

Frame = npt.NDArray[np.uint8]
SIZE = (400, 360)


def frame_of(renderer: Renderer, batch: posse.Batch, **settings: Any) -> Frame:
    frame = renderer.draw(batch, **settings)
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
    frame = frame_of(renderer, batch, colours=[TRACKER, (0, 0, 255)])
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


def press(*keys: int) -> None:
    for key in keys:
        pygame.event.post(pygame.event.Event(pygame.KEYDOWN, key=key))


def opened() -> tuple[Renderer, Window, posse.Batch]:
    batch = posse.batch("constant", 1, seed=3)
    batch.reset()
    renderer = Renderer(batch.scenario, "human", (400, 300))
    assert renderer.window is not None
    return renderer, renderer.window, batch


def test_a_window_shows_the_frame_above_a_line_with_its_keys() -> None:
    renderer, _, batch = opened()
    assert renderer.draw(batch) is None
    surface = pygame.display.get_surface()
    assert surface is not None
    shown = pygame.surfarray.array3d(surface).swapaxes(0, 1)
    np.testing.assert_array_equal(shown[:300], frame_of(Renderer(batch.scenario, size=(400, 300)), batch))
    assert (shown[300:] < 200).any()
    renderer.close()
    assert not pygame.display.get_init()


def test_the_window_of_an_environment_can_be_paused_stepped_and_closed() -> None:
    env = posse.parallel_env("constant", render_mode="human")
    env.reset(seed=0)
    actions = {agent: env.action_space(agent).sample() for agent in env.agents}
    press(pygame.K_SPACE, pygame.K_s, pygame.K_s)
    env.step(actions)  # paused, and one step
    env.step(actions)  # one more
    pressed = []

    def late(key: int) -> None:
        pressed.append(key)
        press(key)

    for key in (pygame.K_s, pygame.K_SPACE):  # pressed after a while, until when the window stays
        threading.Timer(0.3, late, (key,)).start()
        env.step(actions)
        assert pressed.pop() == key
    env.step(actions)  # goes on by itself
    press(pygame.K_EQUALS)
    assert env.render() is None
    assert pygame.event.peek(pygame.KEYDOWN), "the window is drawn by steps alone"
    press(pygame.K_SPACE, pygame.K_ESCAPE)
    env.step(actions)
    env.step(actions)  # without a window
    assert env.render() is None
    assert not pygame.display.get_init()
    env.close()


def test_speed_is_that_of_the_world_and_can_be_changed() -> None:
    renderer, window, batch = opened()
    for keys, speed in (((pygame.K_MINUS,), 0.5), ((pygame.K_EQUALS,) * 6, 8.0), ((pygame.K_MINUS,) * 3, 1.0)):
        press(*keys)
        for _ in range(6):  # at the highest speed, one in six is shown
            renderer.draw(batch)
        assert window.speed == speed
    pygame.event.post(pygame.event.Event(pygame.QUIT))
    renderer.draw(batch)
    assert renderer.window is None


@pytest.mark.parametrize("driver", [None, "no such driver"])
def test_without_a_display_the_error_says_what_to_do(driver: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"):
        monkeypatch.delenv(name, raising=False)
    if driver is not None:
        monkeypatch.setenv("SDL_VIDEODRIVER", driver)
    with pytest.raises(RuntimeError, match=r"no window can be opened.*render_mode='rgb_array'"):
        opened()
