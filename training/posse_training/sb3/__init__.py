"""Training with stable-baselines3; needs the extra ``training``."""

from __future__ import annotations

from posse_training.errors import require

require("training", "torch", "stable_baselines3")

from posse_training.sb3.normalisation import Normaliser, RunningStatistics  # noqa: E402
from posse_training.sb3.policies import ModelPolicy, from_sb3  # noqa: E402
from posse_training.sb3.vec_env import TeamVecEnv  # noqa: E402

__all__ = ["ModelPolicy", "Normaliser", "RunningStatistics", "TeamVecEnv", "from_sb3"]
