"""The scratch memory of the kernels: the fields of rules and signals in one record."""

from __future__ import annotations

from typing import Final

from posse.rules.scratch import MOVING, SENSING, WORLD_FIELDS, scratch_record
from posse.signals.views import OBSERVING

_KEPT: Final = (
    ("prepared", 8),  # not 0 once the values common to all worlds are written
    *WORLD_FIELDS,
)

SCRATCH: Final = scratch_record(_KEPT, MOVING, SENSING, OBSERVING)
