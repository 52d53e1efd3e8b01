"""Evaluation, comparison, figures and films."""
