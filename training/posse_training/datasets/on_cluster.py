"""Episodes recorded on a cluster, which come back as arrays and become buffers again."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np
from minari.data_collector import EpisodeBuffer

from posse import Scenario
from posse_baselines import Policy
from posse_training.cluster.collect import collect
from posse_training.cluster.identity import installed, policy_identity
from posse_training.cluster.progress import ClusterProgress
from posse_training.cluster.ray_backend import RayBackend
from posse_training.cluster.settings import Cluster
from posse_training.cluster.shards import Arrays, Job, Shard, cut
from posse_training.cluster.store import Folder
from posse_training.datasets.episodes import Part, play_part

_EPISODES: Final = 20
"""Episodes of a shard: some 20 MB for five trackers."""
_STEPS: Final = ("observations", "actions", "rewards", "terminations", "truncations")


@contextlib.contextmanager
def recorded_on_cluster(
    players: Sequence[Policy], scenario: Scenario, episodes: int, seed: int, split: str, cluster: Cluster
) -> Iterator[Iterator[Part]]:
    """Have episodes played on a cluster; yield an iterator over them in their order.

    What the workers returned is removed when the block ends without an error.

    Raises:
        ClusterError: No cluster, a shard whose workers died, or the work folder is in use.
    """
    names = [player.name for player in players]
    job = Job(
        f"recording {' and '.join(names)} on {scenario.name}",
        record_on_worker,
        (tuple(players), scenario, seed, split),
        cut(episodes, min(_EPISODES, cluster.worlds)),
        {
            "policies": [policy_identity(player) for player in players],
            "scenario": scenario.to_dict(),
            "seed": seed,
            "split": split,
            "installed": installed(),
            "kind": "recording",
        },
    )
    store = Folder(cluster.work)
    with contextlib.ExitStack() as stack:
        backend = stack.enter_context(RayBackend(cluster))
        stack.enter_context(store.held(job))
        with ClusterProgress(job.name) as watcher:
            failed = collect([job], backend, store, watcher, cluster.attempts)
        if failed:
            raise failed[job]
        yield (_part(arrays, shard, names, seed) for arrays, shard in zip(store.iterate(job), job.shards, strict=True))
    store.remove(job)


def record_on_worker(players: Sequence[Policy], scenario: Scenario, seed: int, split: str, shard: Shard) -> Arrays:
    """Play the episodes of a shard; return their arrays, named ``EPISODE/WHAT``."""
    arrays: Arrays = {}
    buffers, about = play_part(players, scenario, seed, split, shard)
    for k, (buffer, metadata) in enumerate(zip(buffers, about, strict=True)):
        infos: Any = buffer.infos
        found = {name: getattr(buffer, name) for name in _STEPS}
        found["score"] = infos["score"]
        found |= {f"reward/{name}": column for name, column in infos["reward"].items()}
        found |= {f"metrics/{name}": value for name, value in metadata.items() if name not in ("policy", "world")}
        arrays |= {f"{k}/{name}": np.asarray(value) for name, value in found.items()}
    return arrays


def _part(arrays: Arrays, shard: Shard, names: Sequence[str], seed: int) -> Part:
    """Return the buffers and metadata that arrays hold."""
    buffers, about = [], []
    for k in range(shard.count):
        found = {name.removeprefix(f"{k}/"): array for name, array in arrays.items() if name.startswith(f"{k}/")}
        world = shard.first + k
        metrics = {
            name.removeprefix("metrics/"): float(array) for name, array in found.items() if name.startswith("metrics/")
        }
        terms = {name.removeprefix("reward/"): array for name, array in found.items() if name.startswith("reward/")}
        buffers.append(
            EpisodeBuffer(
                id=world,
                seed=seed,
                observations=found["observations"],
                actions=found["actions"],
                rewards=found["rewards"].tolist(),
                terminations=found["terminations"].tolist(),
                truncations=found["truncations"].tolist(),
                infos={"score": found["score"], "reward": terms},
            )
        )
        about.append({"policy": names[world % len(names)], "world": world, **metrics})
    return buffers, about
