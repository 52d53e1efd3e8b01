"""The constant motion: straight ahead."""

from __future__ import annotations

from posse.numeric import Record
from posse.rules.targets.declaring import target_motion


@target_motion("constant")
def constant(c: Record, w: Record) -> None:
    """Straight ahead at the initial heading (paper, section 2)."""
