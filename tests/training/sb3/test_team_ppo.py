"""What PPO remembers of episodes is what stable-baselines3's own would."""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
from stable_baselines3 import PPO

from posse_training.sb3.team_ppo import TeamPPO


def buffers_of(kind: type[PPO], infos: list[dict[str, Any]], dones: Any) -> tuple[Any, Any]:
    model = kind.__new__(kind)
    model.ep_info_buffer, model.ep_success_buffer = deque(maxlen=5), deque(maxlen=5)
    model._update_info_buffer(infos, dones)
    return list(model.ep_info_buffer), list(model.ep_success_buffer)


def test_episodes_are_remembered_as_by_stable_baselines3() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        dones = rng.random(40) < 0.1
        infos: list[dict[str, Any]] = [
            {"episode": {"r": k}, "is_success": k % 2 == 0} if done else {}
            for k, done in enumerate(dones)
        ]
        assert buffers_of(TeamPPO, infos, dones) == buffers_of(PPO, infos, dones)
    assert buffers_of(TeamPPO, infos, None) == buffers_of(PPO, infos, None)
