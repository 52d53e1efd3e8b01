"""From held keys to the action of a robot."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Final

import pygame

LEFT: Final = frozenset({pygame.K_LEFT, pygame.K_a})
RIGHT: Final = frozenset({pygame.K_RIGHT, pygame.K_d})
FASTER: Final = frozenset({pygame.K_UP, pygame.K_w})
SLOWER: Final = frozenset({pygame.K_DOWN, pygame.K_s})
KEYS: Final = LEFT | RIGHT | FASTER | SLOWER
_CHANGE: Final = 2.0  # of the speed's action per second: from rest to full speed in a second


@dataclass(frozen=True)
class Wheel:
    """What is asked of the robot.

    Attributes:
        speed: In [-1, 1]: -1 is rest, 1 full speed. It stays when no key is held.
        turn: In {-1, 0, 1}; 1: as far to the left as possible. It ends with the key.
    """

    speed: float = 1.0
    turn: float = 0.0


def steer(wheel: Wheel, held: Collection[int], seconds: float) -> Wheel:
    """Return what is asked for after keys of pygame were held for some time."""
    pressed = set(held)
    change = bool(pressed & FASTER) - bool(pressed & SLOWER)
    turn = bool(pressed & LEFT) - bool(pressed & RIGHT)
    speed = min(max(wheel.speed + change * _CHANGE * seconds, -1.0), 1.0)
    return Wheel(speed, float(turn))
