"""A window on the screen, and the loop that keeps it up to date."""

from __future__ import annotations

import os
import sys
from typing import Final, Protocol

import pygame

from posse_training.errors import SettingsError

_RATE: Final = 30  # frames per second
_LONGEST: Final = 0.2  # s; a slow frame does not make the next one jump


class Shown(Protocol):
    """What a window shows."""

    @property
    def closed(self) -> bool:
        """Whether the user has closed it."""

    def handle(self, event: pygame.event.Event) -> None:
        """React to an event."""

    def tick(self, seconds: float) -> None:
        """Let real time pass."""

    def draw(self) -> pygame.Surface:
        """Return a picture of the window."""


def open_window(size: tuple[int, int], caption: str, instead: str) -> None:
    """Open a window that can be resized.

    Args:
        size: Width and height, px.
        caption: Text of the title bar.
        instead: What to do where there is no display, for the error.

    Raises:
        SettingsError: There is no display.
    """
    try:
        if sys.platform.startswith("linux") and not any(
            os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER")
        ):
            raise pygame.error("neither DISPLAY nor WAYLAND_DISPLAY is set")
        pygame.display.init()
        pygame.display.set_mode(size, pygame.RESIZABLE)
    except pygame.error as error:
        pygame.display.quit()
        raise SettingsError(
            f"No window can be opened: {error}. Run this where there is a display"
            + (f", or {instead}" if instead else "")
        ) from error
    pygame.display.set_caption(caption)
    pygame.key.set_repeat(350, 40)


def show(picture: pygame.Surface) -> None:
    """Show a picture in the window, if one is open."""
    surface = pygame.display.get_surface()
    if surface is not None:
        surface.blit(picture, (0, 0))
        pygame.display.flip()


def run(shown: Shown) -> None:
    """Show something in the open window until the user closes it, then close the window."""
    clock = pygame.time.Clock()
    try:
        while not shown.closed:
            for event in pygame.event.get():
                shown.handle(event)
            shown.tick(min(clock.tick(_RATE) / 1000, _LONGEST))
            show(shown.draw())
    finally:
        pygame.display.quit()
