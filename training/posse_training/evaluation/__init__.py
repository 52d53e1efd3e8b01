"""Evaluations: episodes played with a policy, their metrics, and estimates from them."""

from posse_training.evaluation.evaluation import evaluate
from posse_training.evaluation.results import Results
from posse_training.evaluation.statistics import Estimate

__all__ = ["Estimate", "Results", "evaluate"]
