"""Colours of replays and films beyond those of a frame (:mod:`posse.rendering.style`)."""

from __future__ import annotations

from typing import Final

from posse.rendering.style import INK, Colour

TASK_COLOURS: Final[tuple[Colour, ...]] = ((86, 180, 233), (0, 114, 178), (0, 158, 115), (240, 228, 66))
"""Of the tasks of a tracker, in the order of ``posse_baselines.ddcs.TASKS``. The last is not Okabe and Ito's pink,
which deuteranopia maps to the grey of a tracker."""
PLAYERS: Final[tuple[Colour, ...]] = ((0, 114, 178), (213, 120, 0), (40, 165, 130), INK)
"""Of the teams compared in one replay or film, left to right."""
