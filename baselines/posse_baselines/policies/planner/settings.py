"""Every setting of the planner, with unit and range."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from posse_baselines.tuning import number


@dataclass(frozen=True, kw_only=True)
class PlannerSettings:
    """How far the planner looks ahead, and what it tries. Units and ranges: each field's metadata.

    Raises:
        ValueError: A number out of its range.
    """

    look_ahead: float = number(4.0, "s", 0.1, 20.0)
    """How far each try is played ahead."""
    keep: float = number(0.5, "s", 0.01, 20.0)
    """How long the best is kept before the next planning; no longer than ``look_ahead``."""
    rounds: int = number(2, "", 0, 20)
    """Rounds of variations on the best so far, after the standard ways of playing."""
    varied: float = number(0.5, "", 0.0, 1.0)
    """Share of the trackers whose way a variation changes."""
    spread: float = number(0.2, "", 0.01, 1.0)
    """Standard deviation of a change, as a share of the range."""
    distance_cost: float = number(1.0, "1/m", 0.0, 100.0)
    """What a metre of mean distance from free slots at the end of a try costs, in steps' scores."""
    seed: int = number(0, "", 0, 2**63 - 1)
    """Of the variations and of what copies draw."""

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value, low, high = (getattr(self, field.name), field.metadata["low"], field.metadata["high"])
            whole = isinstance(field.default, int)
            if isinstance(value, bool) or not isinstance(value, int if whole else (int, float)):
                kind = "a whole number" if whole else "a number"
                raise ValueError(f"{field.name}={value!r} must be {kind}")
            if not low <= value <= high:
                unit = field.metadata["unit"]
                raise ValueError(f"{field.name}={value!r} must lie in [{low}, {high}] {unit}".strip())
        if self.keep > self.look_ahead:
            raise ValueError(
                f"keep={self.keep!r} must be at most look_ahead={self.look_ahead!r}: what comes "
                "after it was not played ahead"
            )
