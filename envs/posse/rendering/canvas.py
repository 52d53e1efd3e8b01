"""An anti-aliased surface, and the window that shows it: the only module that uses pygame."""

import math
import os
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Final

import numpy as np
import numpy.typing as npt

os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")

import pygame

from posse.rendering.style import FAINT_INK, INK, PAPER, Colour

_OVERSAMPLED: Final = 3
_FARTHEST: Final = 30_000  # px; pygame's coordinates are integers of 16 bits

Point = Sequence[float] | npt.NDArray[np.float64]


@cache
def _font(size: int) -> pygame.font.Font:
    """Return pygame's bundled font, so that frames are equal on every machine."""
    pygame.font.init()
    pygame.register_quit(_font.cache_clear)  # fonts do not outlive it, and other libraries quit pygame, too
    return pygame.font.Font(None, size)


class Canvas:
    """The surface of a frame: drawn at a higher resolution, then averaged down.

    Coordinates, lengths and ``size`` (width, height) are in pixels of the finished frame. It needs no display.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        self.size = size
        width, height = size
        self._large = pygame.Surface((width * _OVERSAMPLED, height * _OVERSAMPLED), 0, 32)
        self._frame = pygame.Surface(size, 0, 32)

    def box(self, left: float, top: float, width: float, height: float, colour: Colour) -> None:
        """Fill a rectangle."""
        x0, y0, x1, y1 = (round(v * _OVERSAMPLED) for v in (left, top, left + width, top + height))
        pygame.draw.rect(self._large, colour, (x0, y0, x1 - x0, y1 - y0))

    def disc(self, centre: Point, radius: float, colour: Colour, width: float | None = None) -> None:
        """Fill a disc, or draw a circle whose line, ``width`` px, lies inside ``radius``."""
        (place,) = self._places([centre])
        line = 0 if width is None else max(1, round(width * _OVERSAMPLED))
        pygame.draw.circle(self._large, colour, place, round(radius * _OVERSAMPLED), line)

    def line(self, start: Point, end: Point, width: float, colour: Colour) -> None:
        """Draw a straight line."""
        first, last = self._places([start, end])
        pygame.draw.line(self._large, colour, first, last, max(1, round(width * _OVERSAMPLED)))

    def polygon(self, corners: Sequence[Point] | npt.NDArray[np.float64], colour: Colour, width: float = 0.0) -> None:
        """Fill a polygon, or draw its outline of a width above 0."""
        pygame.draw.polygon(self._large, colour, self._places(corners), round(width * _OVERSAMPLED))

    def text(self, text: str, place: Point, size: float, colour: Colour, anchor: float = 0) -> None:
        """Write a line of text; ``place`` is its left end (``anchor`` 0) or its right end (1), at half its height."""
        image = _font(round(size * _OVERSAMPLED)).render(text, True, colour)
        width, height = image.get_size()
        x, y = self._places([place])[0]
        self._large.blit(image, (round(x - anchor * width), round(y - height / 2)))

    def finish(self) -> pygame.Surface:
        """Return the frame; valid until the next call."""
        pygame.transform.smoothscale(self._large, self.size, self._frame)
        return self._frame

    def pixels(self) -> npt.NDArray[np.uint8]:
        """Return a copy of the frame, (H, W, 3) uint8."""
        return np.ascontiguousarray(pygame.surfarray.array3d(self.finish()).swapaxes(0, 1))

    def _places(self, points: Sequence[Point] | npt.NDArray[np.float64]) -> list[list[float]]:
        places = np.asarray(points, np.float64) * _OVERSAMPLED
        return places.clip(-_FARTHEST, _FARTHEST).tolist()  # type: ignore[no-any-return]


KEYS: Final = {"space": "pause", "s": "step", "- +": "speed", "q": "close"}
"""Keys of every window, and what they do; Esc closes it, too."""
_FASTER: Final = {"-": 0.5, "[-]": 0.5, "+": 2.0, "=": 2.0, "[+]": 2.0}  # "=" bears the + on many keyboards
_MOST: Final = 8.0  # times real time, or slower than it
_BAR: Final = 26  # px, of the line of keys below the frame
_POLL: Final = 10  # ms between two looks at the keyboard
_DRAWN: Final = 15  # frames per second, as many as a slow machine draws


class Window:
    """A window that shows frames in real time and can be paused; one at a time in a process.

    A line below the frame names the keys. Keys have pygame's names, such as ``"space"``, ``"n"``.

    Args:
        size: Width and height of a frame, px.
        caption: Text of the title bar.
        rate: Frames per second at speed 1.
        keys: The caller's own keys and what they do.

    Attributes:
        paused: Whether :meth:`show` waits for the user; may be set.
        speed: Multiple of real time, 1/8 to 8.
        pressed: Keys other than the window's that were pressed while the last frame was shown.

    Raises:
        RuntimeError: No display is available.
    """

    def __init__(self, size: tuple[int, int], caption: str, rate: float, keys: Mapping[str, str] | None = None) -> None:
        try:
            # Without a display SDL falls back to drivers that show nothing.
            if sys.platform == "linux" and not {"DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"} & os.environ.keys():
                raise pygame.error("neither DISPLAY nor WAYLAND_DISPLAY is set")
            pygame.display.init()
            self._surface = pygame.display.set_mode((size[0], size[1] + _BAR))
        except pygame.error as error:
            pygame.display.quit()
            raise RuntimeError(
                f"no window can be opened ({error}): use render_mode='rgb_array', or set SDL_VIDEODRIVER=dummy"
            ) from error
        pygame.display.set_caption(caption)
        self.paused = False
        self.speed = 1.0
        self.pressed: set[str] = set()
        self._keys = dict(keys or {})
        self._rate = rate
        self._due = 0  # frames since the last one that was shown
        self._last = pygame.time.get_ticks()

    def begin(self) -> bool:
        """Begin the next frame; return whether to draw and show it: at high speeds some are left out."""
        self.pressed.clear()
        self._due += 1
        return self.paused or self._due * _DRAWN >= self._rate * self.speed

    def show(self, frame: pygame.Surface) -> bool:
        """Show a frame for its time; return False once the user has closed the window.

        A paused window shows it until the user steps, goes on, or presses one of the caller's keys.
        """
        if not pygame.display.get_init():  # another library quit pygame
            return False
        self._paint(frame)
        while True:
            while (event := pygame.event.poll()).type != pygame.NOEVENT:  # one by one: a step leaves the others
                key = pygame.key.name(event.key) if event.type == pygame.KEYDOWN else ""
                if event.type == pygame.QUIT or key in ("q", "escape"):
                    return False
                if key == "s":
                    self.paused = True
                    return True
                if key == "space":
                    self.paused = not self.paused
                elif key in _FASTER:
                    self.speed = min(max(self.speed * _FASTER[key], 1 / _MOST), _MOST)
                elif key:
                    self.pressed.add(key)
                self._paint(frame)
            now = pygame.time.get_ticks()
            left = self._last + 1000 * self._due / (self._rate * self.speed) - now
            if self.pressed & self._keys.keys() or (left <= 0 and not self.paused):
                self._last, self._due = now, 0
                return True
            pygame.time.wait(_POLL if left <= 0 else math.ceil(min(left, _POLL)))

    def held(self, *keys: str) -> set[str]:
        """Return those of some keys that are down, or were pressed while the last frame was shown."""
        down = pygame.key.get_pressed()
        return {key for key in keys if key in self.pressed or down[pygame.key.key_code(key)]}

    def close(self) -> None:
        """Close the window."""
        pygame.display.quit()

    def _paint(self, frame: pygame.Surface) -> None:
        """Draw the frame and the line below it: keys on the left, speed on the right."""
        width, height = frame.get_size()
        self._surface.fill(PAPER)
        self._surface.blit(frame, (0, 0))
        *most, close = KEYS.items()
        keys = "   ".join(f"{key.capitalize()}: {what}" for key, what in (*most, *self._keys.items(), close))
        size = max(8, min(18, 18 * (width - 120) // _font(18).size(keys)[0]))
        state = _font(size).render("paused" if self.paused else f"{self.speed:g}× speed", True, INK)
        line = height + (_BAR - state.get_height()) // 2
        self._surface.blit(_font(size).render(keys, True, FAINT_INK), (14, line))
        self._surface.blit(state, (width - 14 - state.get_width(), line))
        pygame.display.flip()
