"""Play contenders such that the failure of one costs only its own rows.

Policies that ship and policy files are played in this process. A ``package.module:Class`` is code
that may hang or crash: it is loaded and played in a process of its own, which is ended when it
exceeds the time limit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import posse_baselines
from posse import Scenario
from posse_baselines import Policy, PolicyError
from posse_training.errors import SettingsError, TimeLimitError, TrainedSplitError
from posse_training.replay import Replay, record
from posse_training.reports.comparing.contenders import Contender
from posse_training.reports.comparing.plays import Plays
from posse_training.reports.comparing.worker import Worker
from posse_training.reports.evaluation import evaluate
from posse_training.reports.failures import PlayError, describe
from posse_training.reports.results import Results

Play = tuple[Contender, Scenario, int]
"""A contender, a scenario and a number of episodes."""


class Players:
    """Plays contenders; a context manager that ends the process of code policies.

    Args:
        time_limit: Time for all episodes of one policy on one scenario, s.
        target: What :func:`evaluate` takes; default: the scenarios' own.
    """

    def __init__(self, time_limit: float, target: str | None = None) -> None:
        self._limit = time_limit
        self._target = target
        self._worker = Worker()
        self._ended: dict[str, str] = {}

    def __enter__(self) -> Players:
        return self

    def __exit__(self, *_: object) -> None:
        self._worker.end()

    def check(self, contender: Contender) -> None:
        """Load the code policies of a contender.

        Raises:
            PolicyError: One cannot be loaded within the time limit.
        """
        for policy in contender.policies:
            if isinstance(policy, str):
                self._load_elsewhere(policy)

    def expect(self, plays: Iterable[Play], seed: int, split: str) -> None:
        """Announce what will be asked for, so that it can be played in parallel."""

    def forget(self) -> None:
        """Delete what a repetition would resume from: all results are written."""

    def play(
        self,
        contender: Contender,
        scenario: Scenario,
        episodes: int,
        seed: int,
        split: str,
        advance: Callable[[int], object],
    ) -> Plays:
        """Play the same worlds with every policy of a contender.

        ``advance`` is called with the number of control steps played, from time to time.

        Raises:
            PolicyError: A policy does not fit the scenario.
            PlayError: A policy failed, or was ended by the time limit before.
        """
        if contender.label in self._ended:
            raise PlayError(self._ended[contender.label])
        results: list[Results] = []
        for policy in contender.policies:
            try:
                results.append(self._play(policy, scenario, episodes, seed, split, advance))
            except (PolicyError, SettingsError, TrainedSplitError):
                raise
            except EOFError as error:
                raise PlayError(str(error)) from error
            except TimeLimitError as error:
                # The next scenario would most likely take as long.
                self._ended[contender.label] = f"not played: on {scenario.name} {error}"
                raise PlayError(str(error)) from error
            except Exception as error:
                raise PlayError(describe(error)) from error
        return Plays(contender.label, tuple(results))

    def _play(
        self,
        policy: str | Policy,
        scenario: Scenario,
        episodes: int,
        seed: int,
        split: str,
        advance: Callable[[int], object],
    ) -> Results:
        if isinstance(policy, str):
            given = (policy, scenario, episodes, seed, split, self._limit, self._target)
            found: Results = self._worker.call(_evaluate, given, self._limit, advance)
            return found
        return evaluate(
            policy, scenario, episodes, seed, split=split, target=self._target, progress=advance, time_limit=self._limit
        )

    def _load_elsewhere(self, policy: str) -> tuple[str, int]:
        """Load a code policy in the worker's process; return its name and message size."""
        try:
            name, size = self._worker.call(_check, (policy,), self._limit)
        except (TimeLimitError, EOFError) as error:
            raise PolicyError(f"{policy!r} cannot be loaded: {error}") from error
        return name, size

    def record(
        self, contender: Contender, member: int, scenario: Scenario, seed: int, world: int, split: str
    ) -> Replay:
        """Play one world again and record it, without observations.

        Args:
            contender: Who plays.
            member: Which of its policies.
            scenario: The scenario.
            seed: Seed of the world.
            world: Index of the world.
            split: Split of the world.

        Raises:
            PlayError: The policy failed.
        """
        given = (contender.label, contender.policies[member], scenario, seed, world, split, self._target)
        try:
            if isinstance(given[1], str):
                found: Replay = self._worker.call(_record, given, self._limit)
                return found
            return _record(None, *given)
        except Exception as error:
            raise PlayError(describe(error)) from error


def _check(report: Any, policy: str) -> tuple[str, int]:
    """Load a policy in the worker's process; return its name and message size."""
    try:
        loaded = posse_baselines.load(policy)
    except PolicyError as error:
        raise PolicyError(str(error)) from None  # without what may not survive pickling
    return loaded.name, loaded.message_size


def _evaluate(
    report: Any, policy: str, scenario: Scenario, episodes: int, seed: int, split: str, limit: float, target: str | None
) -> Results:
    """Evaluate in the worker's process."""
    try:
        return evaluate(policy, scenario, episodes, seed, split=split, target=target, progress=report, time_limit=limit)
    except TimeLimitError:
        raise
    except PolicyError as error:
        raise PolicyError(str(error)) from None  # a subclass may not survive pickling
    except Exception as error:
        raise PlayError(describe(error)) from None


def _record(
    report: Any,
    label: str,
    policy: str | Policy,
    scenario: Scenario,
    seed: int,
    world: int,
    split: str,
    target: str | None,
) -> Replay:
    """Record, in this process or the worker's."""
    try:
        loaded = posse_baselines.load(policy) if isinstance(policy, str) else policy
        return record(
            [(label, loaded)], scenario, target=target, seed=seed, world=world, split=split, observations=False
        )
    except Exception as error:
        raise PlayError(describe(error)) from None
