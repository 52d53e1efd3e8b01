"""The card of a tuning run: what was found, from what, and how well it scores."""

from __future__ import annotations

import platform
from typing import Any, Final

import cmaes
import numpy as np

import posse
from posse_baselines.tuned.files import FORMAT
from posse_training.reports.statistics import mean
from posse_training.tuning.scoring import Scorer
from posse_training.tuning.settings import TuneSettings
from posse_training.tuning.state import State

FRESH_SEED: Final = 1_000
"""Added to the run's seed for the validation worlds on which the result is scored once."""
CHECK_SEED: Final = 2
CHECK_WORLDS: Final = 32


def make_card(settings: TuneSettings, scorer: Scorer, state: State, best: dict[str, Any]) -> dict[str, Any]:
    """Return the card of a finished run, whose best point of the curve is given."""
    values: dict[str, float] = best["settings"]
    fresh = settings.seed + FRESH_SEED
    count = settings.validation_worlds
    check = scorer.scores(values, "validation", 0, CHECK_WORLDS, CHECK_SEED)
    return {
        "format": FORMAT,
        "policy": settings.policy,
        "scenario": scorer.scenario.name,
        "scenario_version": scorer.scenario.version,
        "settings": values,
        "command": settings.command(len(state.generations), state.names),
        "seed": settings.seed,
        "commit": state.commits[-1] if state.commits else None,
        "searched": state.names,
        "generation": best["generation"],
        "curve": [{k: v for k, v in point.items() if k != "settings"} for point in state.curve],
        "trained_splits": ["train"],
        "chosen_on": "validation",
        "scores": {
            "split": "validation",
            "seed": fresh,
            "tuned": _scores(scorer, values, count, fresh),
            "untuned": _scores(scorer, {}, count, fresh),
        },
        "check": {"split": "validation", "seed": CHECK_SEED, "worlds": CHECK_WORLDS, "safe_score": float(check.mean())},
        "software": {
            "cmaes": cmaes.__version__,
            "numpy": np.__version__,
            "posse": posse.__version__,
            "python": platform.python_version(),
        },
    }


def _scores(scorer: Scorer, values: dict[str, float], count: int, seed: int) -> dict[str, Any]:
    metrics = scorer.metrics(values, "validation", 0, count, seed)
    return {
        "safe_score": mean(metrics["safe_score"]).to_dict(),
        "score": float(metrics["score"].mean()),
        "contact_free": float(metrics["contact_free"].mean()),
    }
