"""The scratch memory of the kernels: what rules and signals need of it, in one record."""

from __future__ import annotations

from typing import Final

from posse.rules.scratch import MOVING, SENSING, WORLD_FIELDS, scratch_record
from posse.signals.scratch import observing

_KEPT: Final = (
    ("prepared", 8),  # not 0 once what is the same for all worlds stands there
    *WORLD_FIELDS,
)

SCRATCH: Final = scratch_record(_KEPT, MOVING, SENSING, observing(worlds=8))
SCRATCH_FOR_ONE: Final = scratch_record(_KEPT, MOVING, SENSING, observing(worlds=1))
"""Where worlds are stepped one by one, and memory is short."""
