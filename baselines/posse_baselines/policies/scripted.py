"""The scripted policies, by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from posse_baselines.ddcs import DDCS, Settings
from posse_baselines.policies.oracle import Oracle
from posse_baselines.policies.pursuit import Pursuit
from posse_baselines.policies.simple import Idle, Random
from posse_baselines.policy import Policy

SCRIPTED: Final[dict[str, Callable[[], Policy]]] = {
    "random": Random,
    "idle": Idle,
    "pursuit": Pursuit,
    "ddcs-distributed": DDCS,
    "ddcs-centralized": lambda: DDCS(Settings(model="centralized")),
    "ddcs-centralized-l-l": lambda: DDCS(
        Settings(model="centralized", follower_law="l-l"), "ddcs-centralized-l-l"
    ),
    "ddcs-centralized-no-exchange": lambda: DDCS(
        Settings(model="centralized", exchange=False), "ddcs-centralized-no-exchange"
    ),
    "ddcs-no-radio": lambda: DDCS(Settings(radio=False), "ddcs-no-radio"),
    "pngl": lambda: DDCS(Settings(guidance="pngl"), "pngl"),
    "oracle": Oracle,
}
