"""Plays one contender on one scenario; whatever its policy does costs its own rows only.

Policies of the package and policy files play in this process. One that is code, ``package.module:Class``, plays in a
process of its own, which is ended at the time limit. That is no sandbox.
"""

from __future__ import annotations

import faulthandler
import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from posse import Scenario, ScenarioError
from posse_baselines import Policy, PolicyError, load
from posse_training.cluster import Cluster
from posse_training.compare.contenders import Contender
from posse_training.compare.plays import Plays
from posse_training.errors import ClusterError, SettingsError, TimeLimitError, TrainedSplitError
from posse_training.replay import Replay, record
from posse_training.reports.evaluation import evaluate
from posse_training.reports.failures import PlayError, describe
from posse_training.reports.results import Results

_GRACE: Final = 3.0  # s beyond the limit, in which the policy may notice it by itself


def check(contender: Contender, limit: float) -> None:
    """Load the policies of a contender that are code, each in a process of its own.

    Raises:
        PolicyError: One cannot be loaded within the limit.
    """
    for policy in contender.policies:
        if isinstance(policy, str):
            try:
                _apart(limit, _load, policy)
            except (TimeLimitError, PlayError) as error:
                raise PolicyError(f"{policy!r} cannot be loaded: {error}") from error


def play(
    contender: Contender,
    scenario: Scenario,
    episodes: int,
    seed: int,
    split: str,
    *,
    target: str | None,
    limit: float,
    cluster: Cluster | None = None,
) -> Plays:
    """Play the same worlds with every policy of a contender.

    Raises:
        PolicyError: A policy does not fit the scenario.
        TimeLimitError: A policy exceeded the limit, s, and was ended.
        PlayError: A policy failed.
    """
    results = []
    for policy in contender.policies:
        given = (policy, scenario, episodes, seed, split, target, limit)
        if isinstance(policy, str) and cluster is None:
            found: Results = _apart(limit, _evaluate, *given)
        else:
            found = _evaluate(*given, cluster)
        results.append(found)
    return Plays(contender.label, tuple(results))


def replay(
    contender: Contender,
    member: int,
    scenario: Scenario,
    seed: int,
    world: int,
    split: str,
    *,
    target: str | None,
    limit: float,
) -> Replay:
    """Play one world again with one of a contender's policies and record it, without observations.

    Raises:
        PlayError: The policy failed.
        TimeLimitError: It exceeded the limit, s.
    """
    policy = contender.policies[member]
    given = (contender.label, policy, scenario, seed, world, split, target)
    found: Replay = _apart(limit, _record, *given) if isinstance(policy, str) else _record(*given)
    return found


def _load(policy: str) -> str:
    try:
        return load(policy).name
    except PolicyError as error:
        raise PolicyError(str(error)) from None  # a subclass may not survive pickling


def _evaluate(
    policy: str | Policy,
    scenario: Scenario,
    episodes: int,
    seed: int,
    split: str,
    target: str | None,
    limit: float,
    cluster: Cluster | None = None,
) -> Results:
    try:
        return evaluate(
            policy,
            scenario,
            episodes,
            seed,
            split=split,
            target=target,
            progress=False,
            time_limit=limit,
            ray=cluster or False,
        )
    except PolicyError as error:
        raise PolicyError(str(error)) from None
    except (TimeLimitError, TrainedSplitError, SettingsError, ScenarioError, ClusterError):
        raise
    except Exception as error:
        raise PlayError(describe(error)) from None


def _record(
    label: str, policy: str | Policy, scenario: Scenario, seed: int, world: int, split: str, target: str | None
) -> Replay:
    try:
        loaded = load(policy) if isinstance(policy, str) else policy
        played = {"target": target, "seed": seed, "world": world, "split": split, "observations": False}
        return record([(label, loaded)], scenario, **played)  # type: ignore[arg-type]
    except Exception as error:
        raise PlayError(describe(error)) from None


def _apart(limit: float, function: Callable[..., Any], *arguments: Any) -> Any:
    """Return ``function(*arguments)``, computed in a process of its own.

    Raises:
        TimeLimitError: It took longer than the limit, s; the process was ended.
        PlayError: The process died.
    """
    with tempfile.TemporaryDirectory() as folder:
        given, found = Path(folder, "given"), Path(folder, "found")
        given.write_bytes(pickle.dumps((limit, function, arguments)))
        try:
            done = subprocess.run(
                [sys.executable, "-m", __name__, str(given), str(found)],
                env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
                stdout=subprocess.DEVNULL,
                timeout=limit + _GRACE,
                check=False,
            )
        except subprocess.TimeoutExpired as error:
            raise TimeLimitError(f"it exceeded the time limit of {limit:g} s and was ended") from error
        if not found.exists():
            raise PlayError(f"its process ended with exit code {done.returncode}")
        value = pickle.loads(found.read_bytes())  # noqa: S301 (our own process wrote it)
    if isinstance(value, Exception):
        raise value
    return value


def _answer(given: Path, found: Path) -> None:
    """Compute what a file asks for, and write it, or the error, to another one."""
    limit, function, arguments = pickle.loads(given.read_bytes())  # noqa: S301 (our parent wrote it)
    with Path(os.devnull).open("w") as nowhere:
        # A hanging policy does not outlive a parent that was killed.
        faulthandler.dump_traceback_later(limit + 2 * _GRACE, exit=True, file=nowhere)
        try:
            value = function(*arguments)
        except Exception as error:
            value = error
        partial = found.with_suffix(".partial")
        partial.write_bytes(pickle.dumps(value))
        partial.rename(found)


if __name__ == "__main__":
    from posse_training.compare import playing  # the module that errors are pickled as

    playing._answer(Path(sys.argv[1]), Path(sys.argv[2]))
