"""Learning, evaluation and reports: what needs more than the worlds and their policies."""

from __future__ import annotations

from posse_training.reports.evaluation import Results, evaluate

__all__ = ["Results", "evaluate"]
