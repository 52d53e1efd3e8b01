"""Plays episodes and keeps them as Minari's buffers, one for each world."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from minari.data_collector import EpisodeBuffer

from posse import Batch, Scenario
from posse_baselines import Policy, begin
from posse_training.cluster.shards import Shard

Metrics = dict[str, float]
Part = tuple[list[EpisodeBuffer], list[dict[str, Any]]]
"""Buffers of some episodes, and their metadata."""


def play_part(players: Sequence[Policy], scenario: Scenario, seed: int, split: str, shard: Shard) -> Part:
    """Play an episode in every world of a shard, world i by player i mod their number."""
    buffers, about = [], []
    for i in range(shard.first, shard.first + shard.count):
        policy = players[i % len(players)]
        batch = Batch(scenario, 1, seed=seed, split=split, first_world=i, autoreset="same_step", num_threads=1)
        for buffer, metrics in play_episodes(batch, policy, i):
            buffers.append(buffer)
            about.append({"policy": policy.name, "world": i, **metrics})
    return buffers, about


def play_episodes(batch: Batch, policy: Policy, first: int) -> Iterator[tuple[EpisodeBuffer, Metrics]]:
    """Play one episode in every world; yield its buffer and its metrics.

    Observations are (T + 1, N, F), actions (T, N, 2 + m), rewards (T,), the mean of the team's.
    Infos are ``score`` (T + 1,) and ``reward``, each term by name (T + 1, N); those of the reset are 0.

    Args:
        batch: The worlds, made with ``autoreset="same_step"``.
        policy: Who plays.
        first: Number of the first episode in the data set.
    """
    worlds, trackers = batch.num_worlds, batch.scenario.num_trackers
    memory, seen = begin(policy, batch), batch.reset()
    observations: list[npt.NDArray[Any]] = [seen]
    zeros = {name: np.zeros((worlds, trackers), np.float32) for name in batch.term_names}
    actions: list[npt.NDArray[Any]] = []
    rewards: list[npt.NDArray[Any]] = []
    scores, terms = [np.zeros(worlds)], [zeros]
    lengths = np.zeros(worlds, np.int64)
    terminations = np.zeros(worlds, np.bool_)
    metrics: list[Metrics] = [{} for _ in range(worlds)]
    while (lengths == 0).any():
        acted, memory = policy.act(seen, memory)
        seen, gained, terminated, truncated, infos = batch.step(acted)
        ended = terminated | truncated
        observations.append(infos["final_obs"])
        actions.append(np.array(acted, np.float32))
        rewards.append(gained.mean(axis=1, dtype=np.float64))
        scores.append(infos["score"].astype(np.float64))
        terms.append({name: np.array(infos[f"reward/{name}"]) for name in zeros})
        for e in np.flatnonzero(ended & (lengths == 0)).tolist():
            lengths[e], terminations[e] = len(actions), terminated[e]
            metrics[e] = {name: float(infos[f"metrics/{name}"][e]) for name in batch.metrics()}
        if ended.any():
            memory = policy.restart(memory, ended)
    for e, length in enumerate(lengths.tolist()):
        last = np.arange(length) == length - 1
        buffer = EpisodeBuffer(
            id=first + e,
            seed=batch.seed,
            observations=np.stack([step[e] for step in observations[: length + 1]]),
            actions=np.stack([step[e] for step in actions[:length]]),
            rewards=[float(step[e]) for step in rewards[:length]],
            terminations=(last & terminations[e]).tolist(),
            truncations=(last & ~terminations[e]).tolist(),
            infos={
                "score": np.stack([step[e] for step in scores[: length + 1]]),
                "reward": {name: np.stack([step[name][e] for step in terms[: length + 1]]) for name in zeros},
            },
        )
        yield buffer, metrics[e]
