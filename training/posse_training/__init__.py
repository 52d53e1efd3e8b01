"""Training, evaluation and reports."""

from __future__ import annotations

from posse_training.reports import Results, evaluate

__all__ = ["Results", "evaluate"]
