"""A thread's scratch memory: one record whose fields are float32 arrays.

The fields kept throughout a step come first, then those of the phases of a step, which overlay each
other. Loops run over blocks of eight, so lengths are multiples of eight, including padding of the
last block.
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

WORLD_FIELDS: Final[Fields] = (
    # Discs: trackers, the target, obstacles.
    ("x", DISCS),  # common frame, m
    ("y", DISCS),
    ("radius", DISCS),  # m
    ("sonar_reach2", DISCS),  # squared distance, with a margin, within which the sonar detects it, m²
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
)
MOVING: Final[Fields] = (
    ("worth", 2 * WIDTH),  # value of each direction considered by a smart target
    ("wanted_speed", TEAM),  # commanded by each tracker's action
    ("wanted_turn", TEAM),
    ("new_pose", WIDTH * TEAM),  # eight numbers for each tracker
    ("near", ROBOTS),  # numbers of the robots that are near anything, the target last
    ("near_x", ROBOTS + WIDTH),  # their positions
    ("near_y", ROBOTS + WIDTH),
)
SENSING: Final[Fields] = (
    ("fixed_at", TEAM),  # control step of each tracker's last fix
    ("seen_dx", TEAM),  # vector to the target as seen, m
    ("seen_dy", TEAM),
    ("new_fix", WIDTH * TEAM),  # eight numbers for each tracker
)


def scratch_record(kept: Fields, *phases: Fields) -> np.dtype[Any]:
    """Return the record of scratch memory, in which the phases overlay each other."""
    formats: dict[str, tuple[int, int]] = {}
    begin = end = 0
    for fields in (kept, *phases):
        at = begin
        for name, length in fields:
            if name in formats:
                raise ValueError(f"two fields of scratch memory have the name {name!r}")
            formats[name] = (at, length)
            at += 4 * length
        end = max(end, at)
        begin = at if fields is kept else begin
    layout = {
        "names": list(formats),
        "formats": [(np.float32, (length,)) for _, length in formats.values()],
        "offsets": [offset for offset, _ in formats.values()],
        "itemsize": end,
    }
    return np.dtype((np.record, np.dtype(layout, align=True)))  # type: ignore[call-overload]


def new_scratch(record: np.dtype[Any]) -> Records:
    """Return zeroed scratch memory for one thread and one scenario, an array of one record."""
    memory = np.zeros(record.itemsize + 64, np.uint8)
    start = -memory.ctypes.data % 64  # bytes of a cache line
    return memory[start : start + record.itemsize].view(record)
