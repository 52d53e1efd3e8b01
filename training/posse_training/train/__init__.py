"""Training runs: settings, training, checkpoints."""

from posse_training.train.presets import default_settings
from posse_training.train.settings import TrainSettings, read_settings

__all__ = ["TrainSettings", "default_settings", "read_settings"]
