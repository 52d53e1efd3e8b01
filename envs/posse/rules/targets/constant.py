"""The constant motion: straight on."""

from __future__ import annotations

from posse.numeric import Record
from posse.rules.targets.declaring import target_motion


@target_motion("constant")
def constant(c: Record, w: Record) -> None:
    """Straight on at the heading of the start (paper, section 2)."""
