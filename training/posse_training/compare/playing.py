"""Plays one contender on one scenario; a policy that fails costs its own rows only.

Policies of the package and policy files play in this process. One that is code, ``package.module:Class``, plays in a
process of its own, which is ended at the time limit. That is no sandbox.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from posse import Family, Scenario
from posse_baselines import Policy, PolicyError
from posse_training.compare.contenders import Contender, Plays, check_code
from posse_training.errors import PlayError, TimeLimitError
from posse_training.evaluation.evaluation import Evaluation, evaluate, gathered_results, played_errors, prepare
from posse_training.evaluation.results import Results
from posse_training.parallel import apart
from posse_training.replay import Replay, record

Played = Results | Exception


Key = tuple[str, str, int]
"""Scenario, label of a contender, and which of its policies."""


@dataclass(frozen=True)
class Game:
    """The worlds of a comparison, and what is played there, by the arguments of an evaluation."""

    seed: int
    split: str
    target: str | None
    time_limit: float
    """Of a policy on one scenario, s."""


def play(
    contender: Contender, scenario: Scenario | Family, episodes: int, game: Game, found: Mapping[Key, Played]
) -> Plays:
    """Play the same worlds with every policy of a contender, but for those that are ``found`` already.

    Raises:
        PolicyError: A policy does not fit the scenario.
        TimeLimitError: A policy exceeded the limit and was ended.
        PlayError: A policy failed.
    """
    results = []
    for k, policy in enumerate(contender.policies):
        played = found.get((scenario.name, contender.label, k))
        if isinstance(played, Exception):
            raise played
        if played is None:
            given = (policy, scenario, episodes, game)
            played = apart(game.time_limit, _evaluate, *given) if isinstance(policy, str) else _evaluate(*given)
        results.append(played)
    return Plays(contender.label, tuple(results))


@contextmanager
def played_on_ray(
    contenders: Sequence[tuple[Contender, Scenario | Family, int]],
    game: Game,
    ray: bool | str,
    progress: Callable[[int, int], object],
) -> Iterator[dict[Key, Played]]:
    """Play all of a comparison at once on a Ray cluster; give the results, or why there are none.

    Finished shards are kept until the context ends without an exception.

    Args:
        contenders: Each contender with a scenario and a number of episodes.
        game: What is played.
        ray: The cluster.
        progress: Is called with the number of finished shards and of all.
    """
    found: dict[Key, Played] = {}
    ready: dict[Key, Evaluation] = {}
    for contender, scenario, episodes in contenders:
        for k, policy in enumerate(contender.policies):
            key = scenario.name, contender.label, k
            try:
                if isinstance(policy, str):
                    check_code(policy, game.time_limit)
                with played_errors():
                    ready[key] = prepare(policy, scenario, episodes, **vars(game))
            except (PolicyError, PlayError, TimeLimitError) as error:
                found[key] = error
    total, done = sum(len(one.shards) for one in ready.values()), itertools.count(1)
    with gathered_results(list(ready.values()), ray, lambda: progress(next(done), total)) as results:
        found |= zip(ready, results, strict=True)
        yield found


def replay(contender: Contender, member: int, scenario: Scenario, world: int, game: Game) -> Replay:
    """Play one world again with one of a contender's policies and record it, without observations.

    Raises:
        PolicyError, PlayError: The policy failed.
        TimeLimitError: It exceeded the limit.
    """
    policy = contender.policies[member]
    given = (contender.label, policy, scenario, world, game)
    found: Replay = apart(game.time_limit, _record, *given) if isinstance(policy, str) else _record(*given)
    return found


def _evaluate(policy: str | Policy, scenario: Scenario | Family, episodes: int, game: Game) -> Results:
    with played_errors():
        return evaluate(policy, scenario, episodes, progress=False, **vars(game))


def _record(label: str, policy: str | Policy, scenario: Scenario, world: int, game: Game) -> Replay:
    with played_errors():
        where: dict[str, Any] = {"world": world, "target": game.target, "seed": game.seed, "split": game.split}
        return record([(label, policy)], scenario, observations=False, **where)
