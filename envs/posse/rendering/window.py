"""The window of the mode "human"."""

from __future__ import annotations

import pygame


class Window:
    """A window that shows frames in real time; one at a time in a process.

    Args:
        size: Width and height, px.
        caption: Text of the title bar.
        rate: Maximum frames per second.

    Raises:
        RuntimeError: No display is available.
    """

    def __init__(self, size: tuple[int, int], caption: str, rate: float) -> None:
        try:
            pygame.display.init()
            self._surface = pygame.display.set_mode(size)
        except pygame.error as error:
            raise RuntimeError(
                f"no window can be opened ({error}): use render_mode='rgb_array', or set SDL_VIDEODRIVER=dummy"
            ) from error
        pygame.display.set_caption(caption)
        self._clock = pygame.time.Clock()
        self._rate = rate

    def show(self, frame: pygame.Surface) -> bool:
        """Show a frame at its time; return False once the user has closed the window.

        The escape key closes it, too.
        """
        for event in pygame.event.get():
            escape = event.type == pygame.KEYDOWN and event.key == pygame.K_ESCAPE
            if event.type == pygame.QUIT or escape:
                return False
        self._surface.blit(frame, (0, 0))
        pygame.display.flip()
        self._clock.tick(self._rate)
        return True

    def close(self) -> None:
        """Close the window."""
        pygame.display.quit()
