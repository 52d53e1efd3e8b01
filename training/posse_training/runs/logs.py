"""TensorBoard and Weights & Biases logs of a run, where they are installed."""

from __future__ import annotations

import importlib
import importlib.util
from pathlib import Path
from typing import Any

from stable_baselines3.common.logger import Logger, configure

from posse_training.errors import SettingsError
from posse_training.runs.settings import TrainSettings


def check_wandb(settings: TrainSettings) -> None:
    """Raise if a run is to be logged to Weights & Biases, which is not installed.

    Raises:
        SettingsError: The message says what to install.
    """
    if settings.wandb is not None and importlib.util.find_spec("wandb") is None:
        raise SettingsError(f"wandb={settings.wandb!r} needs Weights & Biases: pip install wandb, or leave it out")


def make_logger(folder: Path, settings: TrainSettings) -> Logger:
    """Return stable-baselines3's logger, which writes TensorBoard files if it is installed.

    Weights & Biases copies these files.
    """
    if settings.wandb is not None:
        wandb: Any = importlib.import_module("wandb")
        wandb.init(
            project=settings.wandb,
            name=folder.name,
            dir=folder,
            config=settings.to_dict(),
            sync_tensorboard=True,
            resume="allow",
        )
    wanted = settings.tensorboard and importlib.util.find_spec("tensorboard") is not None
    return configure(str(folder), ["tensorboard"] if wanted else [])
