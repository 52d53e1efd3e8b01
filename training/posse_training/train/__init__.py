"""Training runs: settings, training, checkpoints."""

from __future__ import annotations

from posse_training.train.settings import TrainSettings, default_settings, read_settings

__all__ = ["TrainSettings", "default_settings", "read_settings"]
