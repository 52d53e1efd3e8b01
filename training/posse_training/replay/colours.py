"""Colours of replays and films beyond those of a frame (:mod:`posse.rendering.style`)."""

from __future__ import annotations

from typing import Final

from posse.rendering.style import INK, Colour

TASK_COLOURS: Final[tuple[Colour, ...]] = ((86, 180, 233), (0, 114, 178), (0, 158, 115), (240, 228, 66))
"""Of the tasks of a tracker, in the order of ``posse_baselines.ddcs.TASKS``. The last is not Okabe and Ito's pink,
which deuteranopia maps to the grey of a tracker."""
PLAYERS: Final[tuple[Colour, ...]] = ((0, 114, 178), (213, 120, 0), (40, 165, 130), INK)
"""Of the teams compared in one replay or film, left to right."""

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
"""The colours of a frame for a dark background."""
DARK_TASK_COLOURS: Final[tuple[Colour, ...]] = ((110, 195, 240), (40, 130, 200), (20, 175, 130), (240, 228, 66))
DARK_PLAYERS: Final[tuple[Colour, ...]] = ((86, 170, 235), (240, 165, 40), (40, 190, 150), (230, 233, 238))
