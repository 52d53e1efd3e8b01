"""A thread's scratch memory: one record, whose fields are arrays of float32.

First what is kept for a world, or for all; then what the phases of a step need, each for itself:
the fields of one phase lie over those of another. Loops go over blocks of eight, so lengths are
multiples of eight, and rows hold what fills the last block.
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
"""The trackers, the target, and what fills the last block."""
DISCS: Final = ROBOTS + -(-MAX_OBSTACLES // WIDTH) * WIDTH
"""The robots, the obstacles, and what fills the last block."""
BEAMS: Final = 64

WORLD_FIELDS: Final[Fields] = (
    # Discs: trackers, the target, obstacles.
    ("x", DISCS),  # common frame, m
    ("y", DISCS),
    ("radius", DISCS),  # m
    ("heard2", DISCS),  # within which the sonar has it, the square, and a little more, m²
    ("index", ROBOTS),  # 0, 1, 2, …
    # The sonar's beams.
    ("beam_cos", BEAMS),
    ("beam_sin", BEAMS),
    ("reading", BEAMS),  # m
    # Trackers.
    ("gap", TEAM),  # free width to the nearest disc, m
    ("excess", TEAM),  # not above 0 if anything is near
    ("slot", TEAM),  # the nearest slot, or the nearest that is free
    ("slot_distance", TEAM),  # and how far it is, m
    ("slot_distance2", TEAM),  # the same squared, m²
)
MOVING: Final[Fields] = (
    ("worth", 2 * WIDTH),  # of each direction that a smart target weighs
    ("wanted_speed", TEAM),  # what each tracker's action asks for
    ("wanted_turn", TEAM),
    ("new_pose", WIDTH * TEAM),  # eight numbers for each tracker
    ("near", ROBOTS),  # the robots that something is near to, the target last: which,
    ("near_x", ROBOTS + WIDTH),  # and where
    ("near_y", ROBOTS + WIDTH),
)
SENSING: Final[Fields] = (
    ("fixed_at", TEAM),  # control step of each tracker's last fix
    ("seen_dx", TEAM),  # where it sees the target, m
    ("seen_dy", TEAM),
    ("new_fix", WIDTH * TEAM),  # eight numbers for each tracker
)


def scratch_record(kept: Fields, *phases: Fields) -> np.dtype[Any]:
    """Return the record of scratch memory; phases are given the same memory."""
    formats: dict[str, tuple[int, int]] = {}
    begin = end = 0
    for fields in (kept, *phases):
        at = begin
        for name, length in fields:
            if name in formats:
                raise ValueError(f"two fields of scratch memory are called {name!r}")
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
    start = -memory.ctypes.data % 64  # a line of the cache
    return memory[start : start + record.itemsize].view(record)
