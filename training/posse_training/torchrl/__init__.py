"""Training with TorchRL; needs the extra ``training``."""

from __future__ import annotations

from posse_training.errors import require

require("training", "torch", "tensordict", "torchrl")

from posse_training.torchrl.env import PosseEnv  # noqa: E402

__all__ = ["PosseEnv"]
