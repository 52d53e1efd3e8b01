"""Tables of policies by scenarios, for pages."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

from posse_training.reports.comparing.comparison import Comparison
from posse_training.reports.statistics import Estimate

REFERENCE: Final = "planner"
"""Reads the state: shown with the others, but never the best of them."""


@dataclass(frozen=True)
class Cell:
    """A value as text, its interval, and whether it is the best of its column."""

    value: str
    interval: str = ""
    best: bool = False


@dataclass(frozen=True)
class Pivot:
    """A table of policies by scenarios."""

    title: str
    meaning: str
    scenarios: tuple[str, ...]
    rows: tuple[tuple[str, tuple[Cell, ...]], ...]


def pivots(found: Comparison) -> list[Pivot]:
    """Return the tables of a comparison: the policies in the order in which they were named."""
    tables = [
        _pivot(found, "safe_score", "Safe score", _MEANINGS["safe_score"], _decimals),
        _pivot(found, "contact_free", "Worlds without a contact", _MEANINGS["contact_free"], _percent),
    ]
    if any(row["of_planner"] is not None for row in found.rows):
        tables.append(_pivot(found, "of_planner", "Share of the planner's", _MEANINGS["of_planner"], _decimals))
    if any(row["difference"] is not None for row in found.rows):
        meaning = _MEANINGS["difference"].format(found.reference)
        tables.append(_pivot(found, "difference", "Difference", meaning, _signed))
    return tables


_MEANINGS: Final = {
    "safe_score": "Mean share of slots held; every step counts 0 from a team's first contact on.",
    "contact_free": "Share of worlds in which no tracker touches anything.",
    "of_planner": "Safe score as a share of the planner's, which reads the full state, in the worlds of both.",
    "difference": "Mean difference of the safe score to {}, paired by world.",
}


def _pivot(
    found: Comparison, column: str, title: str, meaning: str, cell: Callable[[Estimate | float], tuple[str, str]]
) -> Pivot:
    rows = {(row["scenario"], row["policy"]): row for row in found.rows}
    scenarios = tuple(dict.fromkeys(scenario for scenario, _ in rows))
    policies = list(dict.fromkeys(policy for _, policy in rows))
    best = {name: _best([rows.get((name, p)) for p in policies], column) for name in scenarios}
    shown = []
    for policy in policies:
        cells = []
        for name in scenarios:
            row = rows.get((name, policy))
            value = None if row is None else row[column]
            text = ("", "") if value is None else cell(value)
            is_best = policy != REFERENCE and value is not None and _number(value) == best[name]
            cells.append(Cell(*text, best=is_best and column != "difference"))
        shown.append((policy, tuple(cells)))
    return Pivot(title, meaning, scenarios, tuple(shown))


def _best(rows: Sequence[dict[str, Any] | None], column: str) -> float | None:
    """Return the greatest value of those that do not read the state; ``None``: nothing to rank."""
    fair = [
        _number(row[column])
        for row in rows
        if row is not None and row["policy"] != REFERENCE and row[column] is not None
    ]
    return max(fair) if len(fair) > 1 else None


def _number(value: Estimate | float) -> float:
    return value.value if isinstance(value, Estimate) else value


def _decimals(value: Estimate | float) -> tuple[str, str]:
    if isinstance(value, Estimate):
        return f"{value.value:.3f}", f"[{value.low:.3f}, {value.high:.3f}]"
    return f"{value:.2f}", ""


def _signed(value: Estimate | float) -> tuple[str, str]:
    assert isinstance(value, Estimate)
    return f"{value.value:+.3f}", f"[{value.low:+.3f}, {value.high:+.3f}]"


def _percent(value: Estimate | float) -> tuple[str, str]:
    assert isinstance(value, Estimate)
    return f"{100 * value.value:.1f} %", f"[{100 * value.low:.1f}, {100 * value.high:.1f}]"
