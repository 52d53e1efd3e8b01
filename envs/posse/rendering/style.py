"""The style of frames: colours, and lengths in points.

The hues are Okabe and Ito's, which colour-blind people tell apart. The target, its slots and its frame are vermilion,
the team grey or blue. A *point* is a pixel in a frame whose shorter side is :data:`DESIGN_SIZE`.
"""

from typing import Final

Colour = tuple[int, int, int]

DESIGN_SIZE: Final = 640  # px

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
BROKEN: Final[Colour] = (222, 225, 229)
LINK: Final[Colour] = (0, 114, 178)
SENSING: Final[Colour] = (237, 244, 250)
SENSING_RIM: Final[Colour] = (196, 217, 234)
CONTACT: Final[Colour] = (204, 32, 62)


def mix(colour: Colour, ground: Colour, share: float) -> Colour:
    """Return a colour blended over a background with opacity ``share`` in [0, 1]."""
    r, g, b = (round(q + (p - q) * share) for p, q in zip(colour, ground, strict=True))
    return r, g, b
