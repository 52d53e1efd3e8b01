"""How often a team changes its leader."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from posse_baselines import BasePolicy, Policy
from posse_baselines.policy import Memory
from posse_training.reports.results import Column


def leaders_of(policy: Policy, memory: Memory) -> npt.NDArray[Any] | None:
    """Return the leader of each tracker, (E, N); ``None``: the policy has none."""
    if isinstance(policy, BasePolicy):
        return policy.leaders(memory)
    return policy.annotations(memory).get("leader")


class ExchangeCounter:
    """Counts in each world how often the leader of the majority changes."""

    def __init__(self, num_worlds: int) -> None:
        self.total: Column = np.full(num_worlds, np.nan)
        self._leader = np.full(num_worlds, -1)
        self._seen: npt.NDArray[Any] = np.empty(0)

    def count(self, leaders: npt.NDArray[Any] | None, running: npt.NDArray[np.bool_]) -> None:
        """Add one step: the leader of each tracker, (E, N); ``None``: there is none."""
        if leaders is None or np.array_equal(leaders, self._seen):
            return
        self._seen = leaders.copy()
        # The leader of more than half is in the middle of the sorted row.
        n = leaders.shape[1]
        middle = np.sort(leaders, axis=1)[:, n // 2]
        agreed = np.count_nonzero(leaders == middle[:, None], axis=1) > n / 2
        chosen = np.where(agreed, middle, -1)
        known = (chosen >= 0) & running
        self.total[known & np.isnan(self.total)] = 0
        self.total[known & (self._leader >= 0) & (chosen != self._leader)] += 1
        self._leader[known] = chosen[known]
