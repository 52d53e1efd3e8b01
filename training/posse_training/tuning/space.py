"""The search space: tunable settings as points of the unit cube."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from posse_baselines import Tunable

Point = npt.NDArray[np.float64]

_LOG_FROM: Final = 10.0  # ratio of a range's ends from which it is searched by its logarithm
_GAP: Final = 0.02  # of the range; least distance of a setting above another


@dataclass(frozen=True)
class Space:
    """Tunable settings, each mapped to [0, 1].

    A range of positive numbers with a ratio of its ends of 10 or more is mapped by the logarithm.
    """

    tunables: tuple[Tunable, ...]
    fixed: tuple[Tunable, ...] = ()
    """Tunable settings that stay at their defaults; others may have to exceed them."""

    @property
    def start(self) -> Point:
        """The defaults, (n,)."""
        return np.array([_to_unit(t, t.default) for t in self.tunables])

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the settings."""
        return tuple(t.name for t in self.tunables)

    def values(self, point: Point) -> dict[str, float]:
        """Return the settings of a point (n,), those that must exceed another one made to."""
        found = {t.name: _from_unit(t, u) for t, u in zip(self.tunables, point, strict=True)}
        others = {t.name: t.default for t in self.fixed} | found
        for t in (*self.tunables, *self.fixed):
            if not t.above:
                continue
            least = others[t.above] + _GAP * (t.high - t.low)
            value = others[t.name]
            if value < least and (t.name in found or t.above in found):
                found[t.name] = min(t.high, least)
        return found


def _is_log(t: Tunable) -> bool:
    return t.low > 0.0 and t.high / t.low >= _LOG_FROM


def _to_unit(t: Tunable, value: float) -> float:
    if _is_log(t):
        return math.log(value / t.low) / math.log(t.high / t.low)
    return (value - t.low) / (t.high - t.low)


def _from_unit(t: Tunable, unit: float) -> float:
    unit = min(1.0, max(0.0, float(unit)))
    value = t.low * (t.high / t.low) ** unit if _is_log(t) else t.low + unit * (t.high - t.low)
    # Six digits, so that files stay readable; rounding must not leave the range.
    return min(t.high, max(t.low, float(f"{value:.6g}")))


def select(tunables: Sequence[Tunable], names: Sequence[str]) -> tuple[tuple[Tunable, ...], tuple[Tunable, ...]]:
    """Return the tunable settings with these names, and the others."""
    chosen = tuple(t for t in tunables if t.name in names)
    return chosen, tuple(t for t in tunables if t.name not in names)
