"""Who takes part in a comparison: a policy, or one training's policies from several seeds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from posse import Scenario
from posse_baselines import Policy, PolicyError, load
from posse_training.reports.evaluation import Results, evaluate
from posse_training.reports.statistics import (
    Estimate,
    difference_over_seeds,
    interquartile_mean,
    mean,
    middle_mean,
    over_seeds,
    paired_difference,
    share,
)


@dataclass(frozen=True)
class Contender:
    """A policy under the name that reports give it, or one for each training seed."""

    label: str
    policies: tuple[Policy, ...]


def read_contenders(texts: Sequence[str]) -> tuple[Contender, ...]:
    """Return who is meant by names, files, ``package.module:Class``, or ``LABEL=FILE,FILE,...``.

    What comes from a file goes by the name on its card, where nobody else does.

    Raises:
        PolicyError: Nobody, a policy that cannot be loaded, a group without files, or two of one
            label.
    """
    if not texts:
        raise PolicyError("nobody to compare: name a policy or more, the first is compared with")
    found: list[Contender] = []
    stated = {text.partition("=")[0] for text in texts}
    for text in texts:
        label, sign, members = text.partition("=")
        if sign and not (label and all(members.split(","))):
            raise PolicyError(f"{text!r} is no group of policies: write LABEL=FILE,FILE,...")
        taken = {other.label for other in found}
        if label in taken:
            raise PolicyError(
                f"two policies are called {label!r}: give one another label, LABEL=..."
            )
        names = members.split(",") if sign else [text]
        policies = tuple(load(name) for name in names)
        if not sign and Path(text).is_file() and policies[0].name not in taken | stated:
            label = policies[0].name
        found.append(Contender(label, policies))
    return tuple(found)


@dataclass(frozen=True)
class Plays:
    """What a contender did in a number of worlds: results for each training seed."""

    label: str
    results: tuple[Results, ...]

    @property
    def scenario(self) -> Scenario:
        """What was played."""
        return self.results[0].scenario

    def __getitem__(self, metric: str) -> npt.NDArray[np.float64]:
        """Return a metric, (S, W): training seeds by worlds."""
        return np.stack([result[metric] for result in self.results])

    def mean(self, metric: str) -> Estimate:
        """Return the mean of a metric that every episode has, seeds and worlds resampled."""
        values = self[metric]
        return mean(values[0]) if len(values) == 1 else over_seeds(values)

    def interquartile_mean(self, metric: str) -> Estimate:
        """Return the mean of the middle half of all episodes."""
        values = self[metric]
        return (
            interquartile_mean(values[0]) if len(values) == 1 else over_seeds(values, middle_mean)
        )

    def share(self, happened: Sequence[npt.NDArray[np.bool_]]) -> Estimate:
        """Return the share of episodes in which something happened; (W,) for each seed."""
        return share(happened[0]) if len(happened) == 1 else over_seeds(np.stack(happened))

    def difference(self, reference: Plays) -> Estimate:
        """Return the mean difference of the score, world by world."""
        mine, theirs = self["score"], reference["score"]
        if len(mine) == len(theirs) == 1:
            return paired_difference(mine[0], theirs[0])
        return difference_over_seeds(mine, theirs)

    def improvement(self, reference: Plays) -> Estimate:
        """Return how often this one is better in a world; a tie is half a time."""
        mine, theirs = self["score"][:, None], reference["score"][None]
        better = ((mine > theirs) + 0.5 * (mine == theirs)).mean(axis=1)
        return mean(better[0]) if len(better) == 1 else over_seeds(better)


def play(
    contender: Contender,
    scenario: str | Scenario,
    episodes: int,
    seed: int,
    split: str,
    *,
    progress: bool = True,
    **overrides: Any,
) -> Plays:
    """Play the same worlds with every policy of a contender; as :func:`evaluate`.

    Raises:
        PolicyError: One that cannot play this scenario.
    """
    return Plays(
        contender.label,
        tuple(
            evaluate(policy, scenario, episodes, seed, split=split, progress=progress, **overrides)
            for policy in contender.policies
        ),
    )
