"""The scripted policies, by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from posse_baselines.ddcs import DDCS, Settings
from posse_baselines.ddcs.baseline import FAMILY
from posse_baselines.fields import Tunable, tunables
from posse_baselines.policies.belief_planner import BeliefPlanner
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
    "belief-planner": BeliefPlanner,
    "planner": Planner,
}


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
