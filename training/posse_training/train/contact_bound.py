"""A bound on the share of episodes with contact, kept by a Lagrange multiplier.

Each contact costs the tracker that makes it the multiplier's value, in addition to the scenario's
reward. Between rollouts the multiplier grows while more episodes have a contact than the bound
allows, and shrinks while fewer have. The share is measured without waiting for episodes to end:
first contacts of the steps of a rollout, divided by the number of episodes that they amount to.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

FIRST: Final = 1.0
"""Multiplier at the start."""
LEAST: Final = 0.01
MOST: Final = 100.0
"""Range of the multiplier."""
_MEMORY: Final = 8.0  # rollouts over which the share is averaged, about
_GAIN: Final = 0.06  # largest change of the multiplier's logarithm in a rollout


class ContactBound:
    """The multiplier, and the measured share of episodes with contact.

    Args:
        bound: Largest share of episodes with contact, above 0 and below 1.

    Attributes:
        multiplier: Present cost of a contact.
        share: Share of episodes with contact lately; ``None`` before the first rollout.
    """

    def __init__(self, bound: float) -> None:
        self.bound = bound
        self.multiplier = FIRST
        self.share: float | None = None

    def update(self, first_contacts: int, episodes: float) -> None:
        """Adapt the multiplier to a rollout.

        Args:
            first_contacts: Episodes whose first contact occurred in the rollout.
            episodes: Number of whole episodes that its steps amount to.
        """
        latest = min(1.0, first_contacts / episodes)
        self.share = latest if self.share is None else self.share + (latest - self.share) / _MEMORY
        excess = min(1.0, self.share / self.bound - 1.0)
        self.multiplier = min(MOST, max(LEAST, self.multiplier * math.exp(_GAIN * excess)))

    def save(self) -> dict[str, Any]:
        """Return the state as plain values."""
        return {"multiplier": self.multiplier, "share": self.share}

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go back to the state of :meth:`save`."""
        self.multiplier, self.share = saved["multiplier"], saved["share"]
