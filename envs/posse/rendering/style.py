"""How the pictures look: colours, and lengths in points.

The hues are Okabe and Ito's, told apart by readers of every colour vision. Everything of the target
is vermilion (the target, its slots, its frame), everything of the team grey or blue, so that a
picture needs no key. A *point* is a pixel in a picture whose shorter side is :data:`DESIGN_SIZE`.
"""

from __future__ import annotations

from typing import Final

Colour = tuple[int, int, int]

DESIGN_SIZE: Final = 640
"""Shorter side of a picture in which a point is a pixel, px."""

PAPER: Final[Colour] = (255, 255, 255)
GROUND: Final[Colour] = (248, 249, 251)
GRID: Final[Colour] = (212, 218, 225)
WALL: Final[Colour] = (120, 127, 137)
OBSTACLE: Final[Colour] = (205, 210, 217)
OBSTACLE_RIM: Final[Colour] = (168, 175, 184)
INK: Final[Colour] = (38, 43, 51)
FAINT_INK: Final[Colour] = (124, 131, 141)

TARGET: Final[Colour] = (213, 94, 0)
SLOT: Final[Colour] = (238, 190, 154)
SLOT_FILLED: Final[Colour] = (250, 221, 199)

TRACKER: Final[Colour] = (150, 156, 165)
TRACKER_RIM: Final[Colour] = (74, 81, 91)
TRAIL: Final[Colour] = (150, 156, 165)
BROKEN: Final[Colour] = (222, 225, 229)
LINK: Final[Colour] = (0, 114, 178)
SENSING: Final[Colour] = (237, 244, 250)
SENSING_RIM: Final[Colour] = (196, 217, 234)
CONTACT: Final[Colour] = (204, 32, 62)

TASKS: Final = ("searching", "converging", "flocking", "leader exchange")
"""The tasks of the control system (paper, section 3.5), by the number that annotations carry."""
TASK_COLOURS: Final[tuple[Colour, ...]] = (
    (86, 180, 233),
    (0, 114, 178),
    (0, 158, 115),
    (204, 121, 167),
)


def mix(colour: Colour, ground: Colour, share: float) -> Colour:
    """Return a colour laid over a ground, as opaque as ``share`` in [0, 1] says."""
    r, g, b = (round(q + (p - q) * share) for p, q in zip(colour, ground, strict=True))
    return r, g, b


def pale(colour: Colour) -> Colour:
    """Return the colour of a tracker that does not have the target in its own sight."""
    return mix(colour, PAPER, 0.45)


PALETTE: Final[tuple[Colour, ...]] = (
    PAPER, GROUND, GRID, WALL, OBSTACLE, OBSTACLE_RIM, INK, FAINT_INK, TARGET, SLOT, SLOT_FILLED,
    TRACKER, TRACKER_RIM, BROKEN, LINK, SENSING, SENSING_RIM, CONTACT, pale(TRACKER),
    *TASK_COLOURS, *(pale(colour) for colour in TASK_COLOURS),
)  # fmt: skip
"""Every flat colour of a picture; all others are blends of these, at edges and in what fades."""
