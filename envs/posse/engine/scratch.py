"""The scratch memory of the kernels: what rules and signals need of it, in one record."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from posse.rules.scratch import MOVING, SENSING, WORLD_FIELDS, scratch_record
from posse.signals.scratch import columns_for, observing


@functools.cache
def scratch_for(width: int, worlds: int) -> np.dtype[Any]:
    """Return the record for one world, or for eight that are observed together.

    Args:
        width: How many numbers the fields of an observation are, sonar and team-mates apart.
        worlds: 1 or 8.
    """
    kept = (
        ("prepared", 8),  # not 0 once what is the same for all worlds stands there
        *WORLD_FIELDS,
        *columns_for(width),
    )
    return scratch_record(kept, MOVING, SENSING, observing(worlds))
