"""The engine as Gymnasium and PettingZoo environments."""

from __future__ import annotations

import gymnasium
import pettingzoo

_GYMNASIUM = {
    "posse/Team-v0": ("posse.adapters.gymnasium_env:TeamEnv", "posse.adapters.vector_env:TeamVectorEnv"),
    "posse/Solo-v0": ("posse.adapters.gymnasium_env:SoloEnv", "posse.adapters.vector_env:SoloVectorEnv"),
}
_PETTINGZOO = "posse/track-v0"


def register() -> None:
    """Register every id; repeated calls have no effect."""
    for name, (entry_point, vector_entry_point) in _GYMNASIUM.items():
        if name not in gymnasium.registry:
            gymnasium.register(name, entry_point=entry_point, vector_entry_point=vector_entry_point)
    registry = getattr(pettingzoo, "parallel_registry", None)  # since PettingZoo 1.27
    if registry is not None and _PETTINGZOO not in registry:
        pettingzoo.register("parallel", _PETTINGZOO, "posse.adapters.pettingzoo_env:parallel_env")
        pettingzoo.register("aec", _PETTINGZOO, "posse.adapters.pettingzoo_env:env")
