"""The scripted policies, by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from posse_baselines.ddcs import DDCS
from posse_baselines.ddcs.baseline import FAMILY
from posse_baselines.policies.belief_planner import BeliefPlanner
from posse_baselines.policies.planner import Planner
from posse_baselines.policies.pursuit import Pursuit
from posse_baselines.policies.simple import Idle, Random
from posse_baselines.policy import Policy
from posse_baselines.tuned import TUNED, TunedDDCS

SCRIPTED: Final[dict[str, Callable[[], Policy]]] = {
    "random": Random,
    "idle": Idle,
    "pursuit": Pursuit,
    **{name: (lambda name=name: DDCS.of(name)) for name in FAMILY},  # type: ignore[misc]
    **{name: (lambda name=name: TunedDDCS(name)) for name in TUNED},  # type: ignore[misc]
    "belief-planner": BeliefPlanner,
    "planner": Planner,
}
