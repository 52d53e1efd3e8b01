"""The target controlled by a policy."""

from __future__ import annotations

from posse.numeric import Record
from posse.rules.targets.declaring import target_motion


@target_motion("agent")
def agent(c: Record, w: Record) -> None:
    """A policy controls the target."""
