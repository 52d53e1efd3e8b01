"""Evaluations and comparisons."""

from __future__ import annotations

from posse_training.reports.evaluation import evaluate
from posse_training.reports.results import Results
from posse_training.reports.statistics import Estimate

__all__ = ["Estimate", "Results", "evaluate"]
