"""The window of the mode "human": pause, one step, speed, close; in anybody's loop."""

import threading

import numpy as np
import pygame
import pytest

import posse
from posse.rendering.canvas import Window
from posse.rendering.renderer import Renderer


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
    frame = Renderer(batch.scenario, size=(400, 300)).draw(batch)
    assert frame is not None
    np.testing.assert_array_equal(shown[:300], frame)
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
