"""The infos of every environment: flat, with the same keys at every reset and step."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from posse.scenarios import Scenario
from posse.signals.generate import declarations_for


class Infos:
    """Builds the infos of a scenario.

    ===================== ==========================================================================
    ``score``             of the team in this step, [0, 1]
    ``reward/<term>``     each reward term, unscaled (``posse.REWARD_TERMS``)
    ``metrics/<metric>``  each metric of the episode (``posse.METRICS``); 0 before the step that ends it
    ``working``           whether a tracker works; only in scenarios where trackers break
    ===================== ==========================================================================

    Args:
        scenario: Names the terms and metrics.
        zero: A metric before the end of the episode.
    """

    def __init__(self, scenario: Scenario, zero: Any) -> None:
        declared = declarations_for(scenario)
        self.rewards = tuple(f"reward/{name}" for name in declared.term_names)
        names = ("score", *self.rewards, *(f"metrics/{metric.name}" for metric in declared.metrics))
        self._template = dict.fromkeys(names, zero)

    def build(
        self, score: Any, terms: Iterable[Any] = (), working: Any = None, metrics: Mapping[str, Any] | None = None
    ) -> dict[str, Any]:
        """Return an info; ``terms`` in the order of the names, ``metrics`` by name where the episode ends."""
        info = self._template.copy()
        info["score"] = score
        info.update(zip(self.rewards, terms))  # noqa: B905 (of equal length; in the hot path)
        if metrics is not None:
            info.update((f"metrics/{name}", value) for name, value in metrics.items())
        if working is not None:
            info["working"] = working
        return info
