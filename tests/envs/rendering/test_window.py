"""Windows, displays and what cannot be drawn."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from tests.support.drawing import SIZE, worlds

import posse
from posse.rendering.renderer import Renderer


def test_importing_the_package_does_not_load_pygame() -> None:
    code = "import sys, posse, posse.rendering.renderer; print('pygame' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False"]


def test_frames_need_no_display() -> None:
    code = (
        "import posse, pygame; from posse.rendering.renderer import Renderer;"
        "b = posse.batch('smart'); b.reset();"
        "print(Renderer(b.scenario).draw(b).shape, pygame.display.get_init())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "(640, 640, 3) False"


def test_a_window_shows_the_frame_and_closes(monkeypatch: pytest.MonkeyPatch) -> None:
    import pygame

    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    batch = worlds()
    window, array = Renderer(batch.scenario, "human", SIZE), Renderer(batch.scenario, size=SIZE)
    try:
        assert window.draw(batch) is None
        surface = pygame.display.get_surface()
        assert surface is not None
        shown = pygame.surfarray.array3d(surface).swapaxes(0, 1)
        np.testing.assert_array_equal(shown, array.draw(batch))
    finally:
        window.close()
    assert not pygame.display.get_init()
    assert window.closed
    window.close()


@pytest.mark.parametrize("event", ["QUIT", "KEYDOWN"])
def test_a_window_that_the_user_closes_stays_closed(event: str, monkeypatch: pytest.MonkeyPatch) -> None:
    import pygame

    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    batch = worlds()
    renderer = Renderer(batch.scenario, "human", SIZE)
    renderer.draw(batch)
    assert not renderer.closed
    settings = {"key": pygame.K_ESCAPE} if event == "KEYDOWN" else {}
    pygame.event.post(pygame.event.Event(getattr(pygame, event), settings))
    renderer.draw(batch)
    assert renderer.closed
    assert not pygame.display.get_init()
    assert renderer.draw(batch) is None
    assert not pygame.display.get_init()


def test_without_a_display_the_error_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "no such driver")
    batch = worlds()
    with pytest.raises(RuntimeError, match=r"no window can be opened.*render_mode='rgb_array'"):
        Renderer(batch.scenario, "human").draw(batch)


def test_a_closed_renderer_says_so() -> None:
    batch = worlds()
    renderer = Renderer(batch.scenario)
    renderer.close()
    with pytest.raises(ValueError, match="closed: make a new one"):
        renderer.draw(batch)


@pytest.mark.parametrize("mode", ["ansi", "", None])
def test_an_unknown_mode_is_named(mode: Any) -> None:
    with pytest.raises(ValueError, match=f"unknown render mode {mode!r}.*human, rgb_array"):
        Renderer(posse.get_scenario("smart"), mode)


@pytest.mark.parametrize("size", [(100, 400), (400,), (400.0, 400)])
def test_an_impossible_size_is_named(size: Any) -> None:
    with pytest.raises(ValueError, match=r"size=.*at least 200 px"):
        Renderer(posse.get_scenario("smart"), size=size)


def test_what_cannot_be_drawn_is_named() -> None:
    batch = posse.batch("smart", 2)
    renderer = Renderer(batch.scenario)
    with pytest.raises(ResetNeeded, match="call reset"):
        renderer.draw(batch)
    batch.reset()
    for world in (2, -1):
        with pytest.raises(ValueError, match=f"world={world} is not in the batch.*0 to 1"):
            renderer.draw(batch, world)
    other = worlds("constant")
    with pytest.raises(ValueError, match="'constant' does not fit a renderer of 'smart'"):
        renderer.draw(other)
