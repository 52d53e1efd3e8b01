"""A comparison in the JSON layout that marl-eval reads, and from it rliable.

Environment, task, algorithm and run are nested; a run holds evaluation steps and, beside them,
``absolute_metrics``.
Here the environment is posse, a task a scenario, an algorithm a policy, a run one of its training
seeds, and each metric a list with one value for each world. Times that some episodes lack are left
out, since JSON has no nan.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from posse_training.compare.contenders import Plays
from posse_training.evaluation.results import Results


def write_marl_eval(plays: Mapping[tuple[str, str], Plays], path: Path) -> None:
    """Write everything that was played, by scenario and policy."""
    tasks: dict[str, dict[str, Any]] = {}
    for (scenario, policy), found in plays.items():
        tasks.setdefault(scenario, {})[policy] = {f"seed_{k}": _run(results) for k, results in enumerate(found.results)}
    text = json.dumps({"posse": tasks}, indent=2, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")


def _run(results: Results) -> dict[str, Any]:
    metrics = {name: column.tolist() for name, column in results.columns.items() if np.isfinite(column).all()}
    return {"step_0": {"step_count": 0, **metrics}, "absolute_metrics": metrics}
