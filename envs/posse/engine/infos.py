"""The infos of every environment: flat, with the same keys at every reset and step."""

from __future__ import annotations

from collections.abc import Mapping
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
        rewards = [f"reward/{name}" for name in declared.term_names]
        self._rewards = tuple(zip(rewards, range(len(rewards)), strict=True))
        names = ("score", *rewards, *(f"metrics/{metric.name}" for metric in declared.metrics))
        self._template = dict.fromkeys(names, zero)

    def build(self, score: Any, metrics: Mapping[str, Any] | None, terms: Any = None) -> dict[str, Any]:
        """Return an info; ``metrics`` by name where the episode ends, ``terms`` (K, ...) in the order of the names."""
        info = self._template.copy()
        info["score"] = score
        if metrics is not None:
            info.update((f"metrics/{name}", value) for name, value in metrics.items())
        if terms is not None:
            for key, k in self._rewards:  # faster than dict.update(zip(...)), which creates tuples
                info[key] = terms[k]
        return info

    def by_agent(
        self, agents: list[str], score: float, metrics: Mapping[str, float] | None, terms: list[list[float]]
    ) -> dict[str, dict[str, Any]]:
        """Return the infos of agents by name, which differ in their own terms (rows, K)."""
        common, rewards, infos = self.build(score, metrics), self._rewards, {}
        for agent, own in zip(agents, terms):  # noqa: B905  equal lengths, in the hot path
            infos[agent] = info = common.copy()
            for key, k in rewards:
                info[key] = own[k]
        return infos
