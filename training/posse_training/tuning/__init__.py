"""Tuning: CMA-ES over the settings of a scripted team that are declared tunable."""

from __future__ import annotations

from posse_training.tuning.settings import TuneSettings

__all__ = ["TuneSettings"]
