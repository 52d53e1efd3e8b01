"""stable-baselines3's PPO for thousands of slots."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from stable_baselines3 import PPO


class TeamPPO(PPO):
    """PPO that looks for ended episodes only where one has ended.

    To look through the infos of all slots takes as long as to step their worlds.
    """

    def _update_info_buffer(
        self, infos: list[dict[str, Any]], dones: npt.NDArray[np.bool_] | None = None
    ) -> None:
        if dones is not None:
            ended = np.flatnonzero(dones)
            infos, dones = [infos[slot] for slot in ended], dones[ended]
        super()._update_info_buffer(infos, dones)
