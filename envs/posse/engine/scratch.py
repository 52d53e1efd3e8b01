"""The scratch memory of the kernels: what rules and signals need of it, in one record."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from posse.rules.scratch import MOVING, SENSING, WORLD_FIELDS, scratch_record
from posse.signals.parts import Parts
from posse.signals.scratch import columns_for, observing


@functools.cache
def scratch_for(parts: Parts, worlds: int) -> np.dtype[Any]:
    """Return the record for one world, or for eight that are observed together.

    Args:
        parts: What the kernel is made of.
        worlds: 1 or 8.
    """
    kept = (
        ("prepared", 8),  # not 0 once what is the same for all worlds stands there
        *WORLD_FIELDS,
        *columns_for(parts.width),
    )
    return scratch_record(kept, MOVING, SENSING, observing(parts.mate_width, worlds))
