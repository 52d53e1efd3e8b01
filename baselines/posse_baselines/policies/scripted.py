"""The scripted policies, by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from posse_baselines.ddcs import DDCS, Settings
from posse_baselines.ddcs.baseline import FAMILY
from posse_baselines.fields import Tunable, tunables
from posse_baselines.policies.planner import Planner
from posse_baselines.policies.pursuit import Pursuit
from posse_baselines.policies.simple import Idle, Random
from posse_baselines.policy import Policy, PolicyError
from posse_baselines.tuned import TUNED, TunedDDCS

SCRIPTED: Final[dict[str, Callable[[], Policy]]] = {
    "random": Random,
    "idle": Idle,
    "pursuit": Pursuit,
    **{name: (lambda name=name: DDCS(FAMILY[name], name)) for name in FAMILY},  # type: ignore[misc]
    **{name: (lambda name=name: TunedDDCS(name)) for name in TUNED},  # type: ignore[misc]
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
    "ddcs-centralized-l-l": "the same, followers by l-l from the third robot on",
    "ddcs-centralized-no-exchange": "the first leader stays leader, even when broken",
    "ddcs-no-radio": "ddcs-distributed that ignores messages",
    "ddcs-tuned": "ddcs-distributed with settings tuned for the scenario",
    "pngl-l-phi-tuned": "pngl-l-phi with settings tuned for the scenario",
    "planner": "a reference that reads the state and plays ahead in copies of the world",
}
"""Of each a sentence, as ``posse policies`` shows it."""
ABLATIONS: Final = (
    *("pngl-l-phi-literal", "ddcs-centralized-pursuit", "ddcs-centralized-l-l"),
    *("ddcs-centralized-no-exchange", "ddcs-no-radio"),
)
"""Policies that show what one part of another is good for; lists of names leave them out."""


def settings_of(name: str) -> Settings:
    """Return the settings of a member of the DDCS family.

    Raises:
        PolicyError: No member of that name.
    """
    if name not in FAMILY:
        raise PolicyError(f"policy {name!r} has no settings; those that have: {', '.join(FAMILY)}")
    return FAMILY[name]


def tunable(name: str) -> tuple[Tunable, ...]:
    """Return the settings of a policy that a search may change, with ranges and units.

    Raises:
        PolicyError: The policy has no settings.
    """
    return tunables(settings_of(name))


def with_settings(name: str, **values: Any) -> DDCS:
    """Return a policy with some of its settings changed.

    Raises:
        PolicyError: The policy has no settings.
        ValueError: A value out of its range.
    """
    return DDCS(settings_of(name).replace(**values), name)
