"""The style of frames: colours, and lengths in points.

The colour-blind safe hues are Okabe and Ito's; a test simulates deuteranopia, protanopia and
tritanopia. The target, its slots and its frame are vermilion, the team grey or blue. A *point* is
a pixel in a frame whose shorter side is :data:`DESIGN_SIZE`.
"""

from __future__ import annotations

from typing import Final

Colour = tuple[int, int, int]

DESIGN_SIZE: Final = 640
"""Shorter side of a frame in which a point is a pixel, px."""

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
TASK_COLOURS: Final[tuple[Colour, ...]] = ((86, 180, 233), (0, 114, 178), (0, 158, 115), (240, 228, 66))
"""The last is not Okabe and Ito's pink, which deuteranopia maps to the grey of a tracker."""


def mix(colour: Colour, ground: Colour, share: float) -> Colour:
    """Return a colour blended over a background with opacity ``share`` in [0, 1]."""
    r, g, b = (round(q + (p - q) * share) for p, q in zip(colour, ground, strict=True))
    return r, g, b


def pale(colour: Colour) -> Colour:
    """Return the colour of a tracker that does not see the target itself."""
    return mix(colour, PAPER, 0.45)


PALETTE: Final[tuple[Colour, ...]] = (
    PAPER,
    GROUND,
    GRID,
    WALL,
    OBSTACLE,
    OBSTACLE_RIM,
    INK,
    FAINT_INK,
    TARGET,
    SLOT,
    SLOT_FILLED,
    TRACKER,
    TRACKER_RIM,
    BROKEN,
    LINK,
    SENSING,
    SENSING_RIM,
    CONTACT,
    pale(TRACKER),
    *TASK_COLOURS,
    *(pale(colour) for colour in TASK_COLOURS),
)
"""Every flat colour of a frame; all others are blends of these."""

PLAYERS: Final[tuple[Colour, ...]] = ((0, 114, 178), (213, 120, 0), (40, 165, 130), INK)
"""Colours of the teams compared in one video, left to right."""

DARK: Final[dict[str, Colour]] = {
    "PAPER": (23, 26, 31),
    "GROUND": (29, 33, 39),
    "GRID": (58, 65, 75),
    "WALL": (132, 140, 151),
    "OBSTACLE": (62, 69, 79),
    "OBSTACLE_RIM": (98, 107, 119),
    "INK": (230, 233, 238),
    "FAINT_INK": (148, 156, 167),
    "TARGET": (240, 120, 40),
    "SLOT": (150, 92, 52),
    "SLOT_FILLED": (108, 66, 38),
    "TRACKER": (140, 147, 157),
    "TRACKER_RIM": (222, 226, 232),
    "TRAIL": (140, 147, 157),
    "BROKEN": (72, 78, 87),
    "LINK": (86, 180, 233),
    "SENSING": (32, 47, 61),
    "SENSING_RIM": (58, 92, 122),
    "CONTACT": (255, 70, 100),
}
"""The same colours for a dark background."""
DARK_TASK_COLOURS: Final[tuple[Colour, ...]] = ((110, 195, 240), (40, 130, 200), (20, 175, 130), (240, 228, 66))
DARK_PLAYERS: Final[tuple[Colour, ...]] = ((86, 170, 235), (240, 165, 40), (40, 190, 150), (230, 233, 238))
