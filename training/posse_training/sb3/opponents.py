"""What the slots of a batch with a policy inside differ in."""

from __future__ import annotations

from typing import Any

import numpy.typing as npt

from posse import Batch, PairedBatch


def arrays_inside(batch: Batch) -> dict[str, npt.NDArray[Any]]:
    """Return the memory of the policy inside as arrays by name; views, not copies."""
    if not isinstance(batch, PairedBatch):
        return {}
    memory: dict[str, npt.NDArray[Any]] = batch.inside.arrays(batch.memory)  # type: ignore[attr-defined]
    return {f"opponent.{name}": array for name, array in memory.items()}


def own_score(batch: Batch, score: float) -> float:
    """Return the score of the side that learns: a target's is what it denies the team."""
    learns = isinstance(batch, PairedBatch) and not batch.moves_target
    return 1 - score if learns else score
