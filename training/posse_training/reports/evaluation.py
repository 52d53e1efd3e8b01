"""Play episodes with a policy and keep a row for each.

Every policy plays the same worlds: world i depends on the seed, the split and i only.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

import posse
from posse import Scenario, get_scenario
from posse_baselines import Policy, Target, against, load, load_target, rollout
from posse_training.cluster import Cluster
from posse_training.cluster.settings import WORLDS, as_cluster
from posse_training.cluster.shards import Shard, cut, joined
from posse_training.errors import SettingsError, TimeLimitError, TrainedSplitError
from posse_training.reports.exchanges import ExchangeCounter, leaders_of
from posse_training.reports.results import Column, Results

__all__ = ["Results", "TrainedSplitError", "evaluate", "play_episode", "progress_bar"]


def evaluate(
    policy: str | Policy,
    scenario: str | Scenario,
    episodes: int = 1000,
    seed: int = 7,
    *,
    target: str | Target | None = None,
    split: str = "test",
    progress: bool | Callable[[int], object] = True,
    num_threads: int | None = None,
    time_limit: float | None = None,
    ray: bool | str | Cluster = False,
    **overrides: Any,
) -> Results:
    """Play episodes of a scenario with a policy, here or on a Ray cluster, with the same result.

    Args:
        policy: A policy, or an argument of :func:`posse_baselines.load`.
        scenario: A scenario or its name.
        episodes: Number of episodes; episode i is world i of the seed.
        seed: Seed of the worlds.
        target: A target, or an argument of :func:`posse_baselines.load_target`; default: the
            scenario's own motion.
        split: Split of the worlds; no training and no tuning uses ``"test"``.
        progress: Whether to show a bar; or a function that is called after each control step with
            the number of steps played, 1; on a cluster after each shard, with its steps.
        num_threads: Threads that step the worlds; never changes a result; on a cluster one a shard.
        time_limit: Time for all episodes, on a cluster for each shard, s, checked after each
            control step; default: none.
        ray: Play on a Ray cluster (extra ``cluster``): its address; ``True`` for the cluster of
            this machine, or else all its cores; or a :class:`posse_training.cluster.Cluster`.
        **overrides: Settings of the scenario.

    Raises:
        SettingsError: ``episodes`` below 1.
        PolicyError: An unknown policy or target, or one that does not fit.
        TrainedSplitError: A split that the policy or the target was trained on.
        TimeLimitError: The time limit is exceeded.
        ScenarioError: An unknown scenario or split, an invalid setting or seed.
        MissingExtraError: Ray is to be used and not installed.
        ClusterError: There is no such cluster, or the workers of one shard died again and again.
        PlayError: The policy failed on the cluster.
    """
    cluster, given = as_cluster(ray), policy
    if isinstance(policy, str):
        policy = load(policy)
    if episodes < 1:
        raise SettingsError(f"episodes={episodes} must be at least 1")
    settings = get_scenario(scenario, **overrides)
    opponent = None if target is None else load_target(target)
    if opponent is not None:
        settings, policy = opponent.fit(settings), against(policy, opponent)
    refuse_trained_split(policy, split)
    settings = settings.replace(message_size=max(settings.message_size, policy.message_size))
    if cluster is not None:
        from posse_training.cluster.evaluation import evaluate_on_cluster, sent

        posse.Batch(settings, 1, seed=seed, split=split)  # raises here what is invalid
        columns = evaluate_on_cluster(
            sent(given, policy) if opponent is None else policy,
            policy.name,
            settings,
            episodes,
            seed,
            split,
            cluster,
            progress=progress,
            time_limit=time_limit,
        )
    elif callable(progress):
        advance = limited(progress, time_limit)
        columns = _play_all(policy, settings, episodes, seed, split, num_threads, advance)
    else:
        with progress_bar(disable=not progress) as bar:
            parts = len(cut(episodes, WORLDS))
            task = bar.add_task(escape(f"{policy.name} on {settings.name}"), total=parts * settings.horizon)
            columns = _play_all(
                policy,
                settings,
                episodes,
                seed,
                split,
                num_threads,
                limited(lambda steps: bar.advance(task, steps), time_limit),
            )
    named = None if opponent is None else opponent.name
    return Results(policy.name, settings, seed, split, columns, named)


def progress_bar(*, disable: bool = False) -> Progress:
    """Return a progress bar, as all commands show it."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        transient=True,
        disable=disable,
    )


def refuse_trained_split(policy: Policy | Target, split: str) -> None:
    """Raise if a policy or a target was trained on this split, by its own account."""
    trained = tuple(getattr(policy, "trained_splits", ()))
    if split in trained:
        raise TrainedSplitError(
            f"{policy.name!r} was trained on the split {split!r}, so that its score there would be "
            "biased: choose another of 'train', 'validation', 'test' than "
            f"{', '.join(map(repr, trained))}"
        )


def limited(advance: Callable[[int], object], time_limit: float | None) -> Callable[[int], object]:
    """Return a function that calls another one, and raises once a time limit is exceeded."""
    if time_limit is None:
        return advance
    ends = time.monotonic() + time_limit

    def check(steps: int) -> None:
        if time.monotonic() > ends:
            raise TimeLimitError(f"it exceeded the time limit of {time_limit:g} s")
        advance(steps)

    return check


def _play_all(
    policy: Policy,
    scenario: Scenario,
    episodes: int,
    seed: int,
    split: str,
    num_threads: int | None,
    advance: Callable[[int], object],
) -> dict[str, Column]:
    return joined(
        [play_shard(policy, scenario, shard, seed, split, num_threads, advance) for shard in cut(episodes, WORLDS)]
    )


def play_shard(
    policy: Policy,
    scenario: Scenario,
    shard: Shard,
    seed: int,
    split: str,
    num_threads: int | None,
    advance: Callable[[int], object],
) -> dict[str, Column]:
    """Play one episode in every world of a shard; return every metric by name, (count,)."""
    batch = posse.Batch(scenario, shard.count, seed=seed, split=split, first_world=shard.first, num_threads=num_threads)
    return play_episode(batch, policy, advance)


def play_episode(
    batch: posse.Batch, policy: Policy, advance: Callable[[int], object] = lambda steps: None
) -> dict[str, Column]:
    """Play one episode in every world of a batch; return every metric by name, (E,).

    They are the batch's metrics and ``leader_exchanges``: how often the leader of the majority
    changed, ``nan`` for policies without leaders.
    """
    columns: dict[str, Column] = {}
    running = np.ones(batch.num_worlds, np.bool_)
    exchanges = ExchangeCounter(batch.num_worlds)
    for step in rollout(batch, policy):
        exchanges.count(leaders_of(policy, step.memory), running)
        ended = running & (step.terminated | step.truncated)
        if ended.any():
            for name in batch.metrics():
                column = columns.setdefault(name, np.full(batch.num_worlds, np.nan))
                column[ended] = step.infos[f"metrics/{name}"][ended]
            running &= ~ended
        advance(1)
        if not running.any():
            break
    columns["leader_exchanges"] = exchanges.total
    return columns
