"""Scores of candidates, and which settings have an effect."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

import posse
from posse import Scenario, get_scenario
from posse_baselines import Policy, PolicyError, Tunable, load, play
from posse_baselines.ddcs.baseline import FAMILY
from posse_baselines.tuning import tunables

_SCREENED_ON: Final = 8  # worlds
Scores = npt.NDArray[np.float64]


@runtime_checkable
class TunablePolicy(Policy, Protocol):
    """A policy whose settings a search can change."""

    settings: Any
    """A dataclass whose fields declare themselves by :func:`posse_baselines.tuning.tuned`."""

    def with_settings(self, **values: Any) -> Policy:
        """Return a policy with some settings changed."""
        ...


def tunable_policy(name: str) -> tuple[TunablePolicy, tuple[Tunable, ...]]:
    """Return a policy and its tunable settings.

    Raises:
        PolicyError: An unknown policy, or one without tunable settings.
    """
    policy = load(name)
    found: tuple[Tunable, ...] = ()
    if isinstance(policy, TunablePolicy) and getattr(policy, "trained_splits", ()) == ():
        found = tunables(policy.settings)
        if found:
            return policy, found
    raise PolicyError(f"policy {name!r:.100} has no tunable settings; those that have: {', '.join(FAMILY)}")


@dataclass(frozen=True)
class Scorer:
    """Plays candidates on the worlds of a scenario.

    Attributes:
        policy: The policy whose settings vary.
        scenario: The scenario, with the policy's messages.
        seed: Seed of the worlds.
        threads: Threads that step them.
        played: Called with the number of episodes after each call.
    """

    policy: TunablePolicy
    scenario: Scenario
    seed: int
    threads: int | None = None
    played: Callable[[int], object] = lambda episodes: None

    @classmethod
    def of(cls, policy: TunablePolicy, scenario: str, seed: int, threads: int | None) -> Scorer:
        """Return a scorer on a named scenario.

        Raises:
            ScenarioError: An unknown scenario.
        """
        found = get_scenario(scenario)
        size = max(found.message_size, policy.message_size)
        return cls(policy, found.replace(message_size=size), seed, threads)

    def metrics(
        self, values: dict[str, float], split: str, first: int, count: int, seed: int | None = None
    ) -> dict[str, Scores]:
        """Return the metrics of a candidate, (count,) each, on worlds ``first`` and following."""
        batch = posse.Batch(
            self.scenario,
            count,
            seed=self.seed if seed is None else seed,
            split=split,
            first_world=first,
            num_threads=self.threads,
        )
        found = play(batch, self.policy.with_settings(**values))
        self.played(count)
        return found

    def scores(self, values: dict[str, float], split: str, first: int, count: int, seed: int | None = None) -> Scores:
        """Return the safe scores of a candidate, (count,)."""
        return self.metrics(values, split, first, count, seed)["safe_score"]

    def scores_of(
        self,
        candidates: Sequence[dict[str, float]],
        split: str,
        first: int,
        count: int,
        report: Callable[[int], object],
    ) -> list[Scores]:
        """Return the safe scores of several candidates on the same worlds, (count,) each.

        Args:
            candidates: Their settings.
            split: Split of the worlds.
            first: The first world.
            count: How many.
            report: Called with the number of candidates scored so far.
        """
        found = []
        for k, values in enumerate(candidates):
            found.append(self.scores(values, split, first, count))
            report(k + 1)
        return found

    def effective(self, found: tuple[Tunable, ...]) -> tuple[str, ...]:
        """Return the names of the settings whose ends of the range change any score.

        In a few training worlds. The others only add dimensions to the search.
        """
        usual = self.scores({}, "train", 0, _SCREENED_ON)
        names = []
        for t in found:
            values = {o.name: o.default for o in found}
            for end in (t.low, t.high):
                if _allowed(found, {**values, t.name: end}) and np.any(
                    self.scores({t.name: end}, "train", 0, _SCREENED_ON) != usual
                ):
                    names.append(t.name)
                    break
        return tuple(names)


def _allowed(found: tuple[Tunable, ...], values: dict[str, float]) -> bool:
    return all(values[t.name] > values[t.above] for t in found if t.above)
