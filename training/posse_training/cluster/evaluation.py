"""Episodes played on a cluster: jobs, what a worker does, and an evaluation of one policy."""

from __future__ import annotations

import contextlib
import faulthandler
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

from posse import Scenario, ScenarioError
from posse_baselines import Policy, PolicyError, Target, against, load, policy_names
from posse_baselines.registry import is_code
from posse_training.cluster.collect import Watcher, collect
from posse_training.cluster.identity import installed, policy_identity
from posse_training.cluster.progress import ClusterProgress
from posse_training.cluster.ray_backend import RayBackend
from posse_training.cluster.settings import Cluster
from posse_training.cluster.shards import Arrays, Job, Shard, cut, joined
from posse_training.cluster.store import Folder
from posse_training.errors import SettingsError, TimeLimitError, TrainedSplitError
from posse_training.reports.episodes import limited, play_shard, refuse_trained_split
from posse_training.reports.failures import PlayError, describe

_GRACE: Final = 4.0  # s beyond the time limit, after which a hanging process is ended


def sent(given: str | Policy, loaded: Policy) -> str | Policy:
    """Return what workers get: a name that they can load themselves, else the loaded policy."""
    is_name = isinstance(given, str) and (given in policy_names() or is_code(given))
    return given if is_name else loaded


def evaluation_job(
    policy: str | Policy,
    label: str,
    scenario: Scenario,
    episodes: int,
    seed: int,
    split: str,
    cluster: Cluster,
    time_limit: float | None,
    target: Target | None = None,
) -> Job:
    """Return the evaluation of a policy as a job.

    Args:
        policy: A policy; a name or ``package.module:Class`` is loaded by the workers.
        label: The policy's name in messages.
        scenario: The scenario, with the policy's messages.
        episodes: Number of episodes.
        seed: Seed of the worlds.
        split: Split of the worlds.
        cluster: Says how many worlds a shard has.
        time_limit: Of a shard, s.
        target: What the policy plays against; default: what it holds, or the scenario's own.
    """
    return Job(
        f"{label} on {scenario.name}",
        play_on_worker,
        (policy, scenario, seed, split, time_limit, target),
        cut(episodes, cluster.worlds),
        {
            "policy": policy_identity(policy),
            "target": None if target is None else policy_identity(target),
            "scenario": scenario.to_dict(),
            "seed": seed,
            "split": split,
            "installed": installed(),
        },
    )


def play_on_worker(
    policy: str | Policy,
    scenario: Scenario,
    seed: int,
    split: str,
    time_limit: float | None,
    target: Target | None,
    shard: Shard,
) -> Arrays:
    """Play one episode in every world of a shard; return the metrics, (count,) each.

    Raises:
        PlayError: The policy failed; the message says where.
    """
    try:
        with _ended_after(time_limit):
            player = against(load(policy) if isinstance(policy, str) else policy, target)
            refuse_trained_split(player, split)
            advance = limited(lambda steps: None, time_limit)
            return play_shard(player, scenario, shard, seed, split, 1, advance)
    except PolicyError as error:
        raise PolicyError(str(error)) from None  # a subclass may not survive pickling
    except (TimeLimitError, TrainedSplitError, SettingsError, ScenarioError):
        raise
    except Exception as error:
        raise PlayError(describe(error)) from None


@contextlib.contextmanager
def _ended_after(time_limit: float | None) -> Iterator[None]:
    """End this process when a block takes longer than the limit, which a hanging policy ignores."""
    if time_limit is None:
        yield
        return
    with Path(os.devnull).open("w") as nowhere:
        faulthandler.dump_traceback_later(time_limit + _GRACE, exit=True, file=nowhere)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()


def evaluate_on_cluster(
    policy: str | Policy,
    label: str,
    scenario: Scenario,
    episodes: int,
    seed: int,
    split: str,
    cluster: Cluster,
    *,
    progress: bool | Callable[[int], object],
    time_limit: float | None,
) -> Arrays:
    """Play episodes with one policy; return the metrics, (episodes,) each.

    Raises:
        ClusterError: No cluster, a shard whose workers died, or the work folder is in use.
        PlayError: The policy failed.
        TimeLimitError: A shard exceeded the time limit.
    """
    job = evaluation_job(policy, label, scenario, episodes, seed, split, cluster, time_limit)
    store = Folder(cluster.work)
    watcher: Watcher
    with contextlib.ExitStack() as stack:
        backend = stack.enter_context(RayBackend(cluster))
        stack.enter_context(store.held(job))
        if callable(progress):
            watcher = _Steps(progress, scenario.horizon)
        else:
            watcher = stack.enter_context(ClusterProgress(job.name, disable=not progress))
        failed = collect([job], backend, store, watcher, cluster.attempts)
        if failed:
            raise failed[job]
        found = joined(store.read(job))
    store.remove(job)
    return found


class _Steps(Watcher):
    """Calls a function with the control steps of each shard that is done."""

    def __init__(self, report: Callable[[int], object], horizon: int) -> None:
        self._report, self._horizon = report, horizon

    def done(self, job: Job, shard: Shard) -> None:
        """See :class:`~posse_training.cluster.collect.Watcher`."""
        self._report(self._horizon)
