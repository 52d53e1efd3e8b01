"""The scratch memory of the kernels: the fields of rules and signals in one record."""

from __future__ import annotations

from typing import Final

from posse.rules.scratch import RULES, scratch_record
from posse.signals.views import OBSERVING

_PREPARED: Final = ("prepared", 8)  # not 0 once the values common to all worlds are written

SCRATCH: Final = scratch_record(_PREPARED, *RULES, *OBSERVING)
