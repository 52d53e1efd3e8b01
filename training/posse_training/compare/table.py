"""The estimates of a comparison, and their table."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from rich import box
from rich.table import Table
from rich.text import Text

from posse_baselines.files import write_json
from posse_training.compare.contenders import Plays
from posse_training.evaluation.results import block_of
from posse_training.evaluation.statistics import Estimate, difference, improvement, middle_mean, over_seeds, share

Row = dict[str, Any]
"""The estimates of one policy on one scenario."""
COLUMNS: Final = {
    "safe_score": "safe score",
    "of_planner": "of the\nplanner's",
    "score": "score",
    "contact_free": "contact\nfree",
    "settled": "settled",
    "difference": "difference",
    "improvement": "better\nin",
    "interquartile_mean": "IQM",
    "bound": "bound",
}
"""Estimates and their headers, as the report shows them."""
_SHORT: Final = ("safe_score", "of_planner", "contact_free", "difference", "improvement")
"""Columns that fit into 80 characters beside the name of a policy."""


def row_of(plays: Plays, reference: Plays | None) -> Row:
    """Return the estimates of one policy on one scenario; differences are of the safe score, to the reference."""
    gaps = None if reference is None else plays.paired(reference)
    block = block_of(plays.scenario)
    return {
        "scenario": plays.scenario.name,
        "policy": plays.label,
        "seeds": len(plays.results),
        "safe_score": over_seeds(plays["safe_score"], block=block),
        "of_planner": None,  # filled in once the planner has played
        "score": over_seeds(plays["score"], block=block),
        "contact_free": share(plays["contact_free"] == 1, block),
        "interquartile_mean": over_seeds(plays["safe_score"], middle_mean, block),
        "bound": over_seeds(plays["bound"], block=block),
        "settled": share(np.isfinite(plays["settling_time"]), block),
        "difference": None if gaps is None else difference(*gaps, block),
        "improvement": None if gaps is None else improvement(*gaps, block),
    }


def ranked(rows: Sequence[Row]) -> list[Row]:
    """Return rows by scenario in the order of play, the best safe score first."""
    played = list(dict.fromkeys(row["scenario"] for row in rows))
    return sorted(rows, key=lambda row: (played.index(row["scenario"]), -row["safe_score"].value))


def table(rows: Sequence[Row], title: str) -> Table:
    """Return the most important estimates, each interval below its value."""
    shown = Table(title=Text(title), box=box.HORIZONTALS, padding=0, show_edge=False)
    shown.add_column("policy", overflow="fold")
    for name in _SHORT:
        shown.add_column(COLUMNS[name], no_wrap=True)
    before = None
    for row in ranked(rows):
        if row["scenario"] != before:
            if before is not None:
                shown.add_section()
            shown.add_row(Text(row["scenario"], style="bold", overflow="fold"))
        before = row["scenario"]
        many = f" ({row['seeds']} training seeds)" if row["seeds"] > 1 else ""
        shown.add_row(Text(f"{row['policy']}{many}"), *(Text(cell(name, row[name])) for name in _SHORT))
    return shown


def cell(name: str, value: Estimate | float | None) -> str:
    """Return an estimate with its interval below it; shares of worlds are shown without."""
    if isinstance(value, Estimate):
        if name in ("contact_free", "improvement", "settled"):
            return f"{100 * value.value:.1f} %"
        return f"{value.value:.3f}\n[{value.low:.3f}, {value.high:.3f}]"
    return "" if value is None else f"{value:.2f}"


def write_marl_eval(plays: Mapping[tuple[str, str], Plays], path: Path) -> None:
    """Write everything that was played in the JSON layout that marl-eval reads, and from it rliable.

    The environment is posse, a task a scenario, an algorithm a policy, a run one of its training seeds, and each metric
    a list with one value for each world: all that are finite in every run, since both want the same of each.
    """
    tasks: dict[str, dict[str, Any]] = {}
    every = [results for found in plays.values() for results in found.results]
    names = [name for name in next(iter(every), ()) if all(np.isfinite(results[name]).all() for results in every)]
    for (scenario, policy), found in plays.items():
        for k, results in enumerate(found.results):
            metrics = {name: results[name].tolist() for name in names}
            run = {"step_0": {"step_count": 0, **metrics}, "absolute_metrics": metrics}
            tasks.setdefault(scenario, {}).setdefault(policy, {})[f"seed_{k}"] = run
    write_json(path, {"posse": tasks})
