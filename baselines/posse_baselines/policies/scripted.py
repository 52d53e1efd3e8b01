"""The scripted policies, by name."""

from collections.abc import Callable
from functools import partial
from typing import Final

from posse_baselines.ddcs import DDCS
from posse_baselines.ddcs.baseline import FAMILY
from posse_baselines.policies.belief_planner import BeliefPlanner
from posse_baselines.policies.planner import Planner
from posse_baselines.policies.simple import Idle, Pursuit, Random
from posse_baselines.policy import Policy
from posse_baselines.tuned import TUNED, TunedDDCS

SCRIPTED: Final[dict[str, Callable[[], Policy]]] = {
    "random": Random,
    "idle": Idle,
    "pursuit": Pursuit,
    **{name: partial(DDCS, settings, name) for name, settings in FAMILY.items()},
    **{name: partial(TunedDDCS, name) for name in TUNED},
    "belief-planner": BeliefPlanner,
    "planner": Planner,
}
MEANINGS: Final = {
    "random": "every action uniform in its box",
    "idle": "all trackers stand still",
    "pursuit": "straight to the target, around what the sonar detects; no formation",
    "pngl-l-phi": "the baseline: a leader under PNGL, followers under l-φ",
    "pngl-l-phi-literal": "the same as printed: c = 0, and φ from the leader's heading",
    "pngl": "everyone under proportional navigation (PNGL)",
    "deviated-pursuit": "everyone under deviated pursuit",
    "velocity-pursuit": "everyone under velocity pursuit; no formation",
    "ddcs-centralized-pursuit": "a leader under velocity pursuit, followers under l-φ",
    "ddcs-distributed": "every tracker holds its own slot by the slot law",
    "ddcs-centralized": "a leader that holds its slot, followers under l-φ",
    "ddcs-centralized-no-exchange": "ablation: the first leader stays leader, even when broken",
    "ddcs-no-radio": "ablation: ddcs-distributed that ignores messages",
    "ddcs-tuned": "ddcs-distributed with settings tuned for the scenario",
    "pngl-l-phi-tuned": "pngl-l-phi with settings tuned for the scenario",
    "belief-planner": "plays ahead in a world of each tracker's own, written from what it observes",
    "planner": "a reference that reads the state and plays ahead in copies of the world",
}
"""Of each a sentence, as ``posse policies`` shows it."""
