"""The paper's Distributed Decision Control System: monitoring, tracking, actuation."""

from __future__ import annotations

from posse_baselines.ddcs.memory import CONVERGING, EXCHANGING, FLOCKING, SEARCHING, TASKS
from posse_baselines.ddcs.policy import DDCS
from posse_baselines.ddcs.settings import Settings

__all__ = ["CONVERGING", "DDCS", "EXCHANGING", "FLOCKING", "SEARCHING", "TASKS", "Settings"]
