"""Copies of worlds with the same present state, and different future random draws.

A copy has its original's poses, speeds, fixes, messages in flight, and current outages and breaks.
Its future draws have another key, so a controller that plans in copies knows the present state but
not the future noise, losses and faults.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse.numeric import Records, kernel
from posse.rules.faults import draw_coming_faults
from posse.rules.randomness import mix
from posse.rules.state import WorldArrays

_COPIES: Final = np.uint64(0x636F70696573)  # distinguishes keys of copies from those of episodes
_SEED: Final = np.uint64(1)
_POSITIVE: Final = np.uint64(2**63 - 1)
_ONE: Final = np.uint64(1)


@kernel
def draw_anew(config: Records, world: Records, tracker: Records, count: int, seed: int, alike: bool) -> None:
    """Give copies, ``count`` consecutive ones per world, new keys, and redraw their faults."""
    c = config[0]
    for i in range(len(world)):
        w = world[i]
        number = np.uint64(0) if alike else np.uint64(i % count) + _ONE
        key = mix(mix(mix(w.key, _COPIES), np.uint64(seed)), np.uint64(w.step))
        w.key = mix(key, number)
        w.seed = mix(w.key, _SEED) & _POSITIVE
        draw_coming_faults(c, w, tracker[i], w.step + 1, w.step)


def write_copies(
    config: Records, original: WorldArrays, copies: WorldArrays, count: int, seed: int, alike: bool
) -> None:
    """Overwrite ``copies`` with ``count`` consecutive copies of each world of ``original``."""
    for theirs, mine in zip(original, copies, strict=True):
        if theirs.size:
            _rows(mine, len(theirs))[...] = _rows(theirs, len(theirs))
    draw_anew(config, copies.world, copies.tracker, count, seed, alike)


def _rows(array: npt.NDArray[Any], num_worlds: int) -> npt.NDArray[np.uint8]:
    """Return an array's memory as (worlds, copies, bytes), since plain bytes are copied fastest."""
    size = array.nbytes // len(array)
    return array.reshape(-1).view(np.uint8).reshape(num_worlds, -1, size)
