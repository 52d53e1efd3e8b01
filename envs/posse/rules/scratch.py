"""A thread's scratch memory: one record whose fields are float32 arrays.

Loops run over blocks of eight, so lengths are multiples of eight, including padding of the last
block.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from posse.numeric import WIDTH, Records
from posse.scenarios.limits import MAX_OBSTACLES, MAX_TRACKERS

Fields = tuple[tuple[str, int], ...]
"""Names and lengths."""

TEAM: Final = MAX_TRACKERS
ROBOTS: Final = TEAM + WIDTH
"""Length of rows of trackers, target and padding."""
DISCS: Final = ROBOTS + -(-MAX_OBSTACLES // WIDTH) * WIDTH
"""Length of rows of robots, obstacles and padding."""
BEAMS: Final = 64
_LINE: Final = 16  # float32 of a cache line

RULES: Final[Fields] = (
    # Discs: trackers, the target, obstacles.
    ("x", DISCS),  # common frame, m
    ("y", DISCS),
    ("radius", DISCS),  # m
    ("index", ROBOTS),  # 0, 1, 2, …
    # The sonar's beams.
    ("beam_cos", BEAMS),
    ("beam_sin", BEAMS),
    ("reading", BEAMS),  # m
    # Trackers.
    ("gap", TEAM),  # clearance to the nearest disc, m
    ("excess", TEAM),  # above 0 only if nothing is near
    ("slot", TEAM),  # number of the nearest slot, or of the nearest free one
    ("slot_distance", TEAM),  # distance to it, m
    ("slot_distance2", TEAM),  # squared, m²
    # Motion.
    ("worth", 2 * WIDTH),  # value of each direction considered by a smart target
    ("wanted_speed", TEAM),  # commanded by each tracker's action
    ("wanted_turn", TEAM),
    ("new_pose", WIDTH * TEAM),  # eight numbers for each tracker
    ("near", ROBOTS),  # numbers of the robots that are near anything, the target last
    ("near_x", ROBOTS + WIDTH),  # their positions
    ("near_y", ROBOTS + WIDTH),
)
"""What the rules need of it."""


def scratch_record(*fields: tuple[str, int]) -> np.dtype[Any]:
    """Return the record of scratch memory, of whole cache lines, so that no two threads write to one."""
    padding = -sum(length for _, length in fields) % _LINE
    return np.dtype((np.record, [(name, np.float32, (length,)) for name, length in (*fields, ("padding", padding))]))


def new_scratch(record: np.dtype[Any], threads: int) -> Records:
    """Return zeroed scratch memory for one scenario, a record for each thread."""
    memory = np.zeros(threads * record.itemsize + 4 * _LINE, np.uint8)
    start = -memory.ctypes.data % (4 * _LINE)
    return memory[start : start + threads * record.itemsize].view(record)
