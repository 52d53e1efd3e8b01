"""The worlds in which a policy wins or loses most against the baseline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from posse_training.reports.comparing.comparison import Comparison

_REFERENCE: Final = "planner"


@dataclass(frozen=True)
class Extreme:
    """One world that a policy and the baseline played.

    Attributes:
        scenario: Name of the scenario.
        policy: Label of the policy.
        seed: Number of its training seed, from 0.
        world: Number of the world.
        mine: Its safe score there.
        baseline: The baseline's safe score there.
    """

    scenario: str
    policy: str
    seed: int
    world: int
    mine: float
    baseline: float

    @property
    def gain(self) -> float:
        """How much higher the policy's safe score is than the baseline's."""
        return self.mine - self.baseline


def extremes(found: Comparison, count: int) -> tuple[list[Extreme], list[Extreme]]:
    """Return the largest wins and the largest losses against the baseline, at most ``count`` each.

    Of each policy on each scenario, only the largest win and the largest loss are candidates, so
    that several of them are shown. The planner, which reads the state, is one where nobody else is.
    """
    others = {policy for _, policy in found.plays} - {found.reference}
    shown = others - {_REFERENCE} or others
    wins: list[Extreme] = []
    losses: list[Extreme] = []
    for (scenario, policy), plays in found.plays.items():
        reference = found.plays.get((scenario, found.reference))
        if policy not in shown or reference is None:
            continue
        mine, theirs = plays["safe_score"], reference["safe_score"][0]
        both = min(mine.shape[1], len(theirs))
        gains = mine[:, :both] - theirs[:both]
        for kept, place in ((wins, gains.argmax()), (losses, gains.argmin())):
            seed, world = divmod(int(place), both)
            kept.append(Extreme(scenario, policy, seed, world, float(mine[seed, world]), float(theirs[world])))
    wins = sorted((one for one in wins if one.gain > 0), key=lambda one: -one.gain)
    losses = sorted((one for one in losses if one.gain < 0), key=lambda one: one.gain)
    return wins[:count], losses[:count]
