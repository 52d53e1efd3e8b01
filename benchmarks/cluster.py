"""Episodes a second on a Ray cluster, by the number of workers, and what they send.

``python benchmarks/cluster.py`` evaluates with 1, 2, ... workers on this machine, and here
without Ray; ``--training`` measures RLlib's PPO by the number of its environment runners instead.
Prints the tables of ``docs/cluster.md``. Needs Ray, and RLlib from ``.venv-recipes``
(``make recipes``).
"""

from __future__ import annotations

import json
import os
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import ray
import tyro
from machine import OtherWork, describe

from posse import get_scenario
from posse_baselines import load
from posse_training import evaluate
from posse_training.cluster import Cluster
from posse_training.cluster.collect import Watcher, collect
from posse_training.cluster.evaluation import evaluation_job, play_on_worker
from posse_training.cluster.ray_backend import RayBackend
from posse_training.cluster.shards import Arrays, Job
from posse_training.cluster.store import Folder

OUT = Path("runs/bench/cluster.json")
_ALONE: dict[str, Any] = {"address": "local", "include_dashboard": False}


@dataclass(frozen=True)
class Settings:
    """What to measure."""

    policy: str = "ddcs-tuned"
    """Policy to evaluate."""
    scenario: str = "smart"
    """Scenario to play."""
    episodes: int = 4_000
    """Episodes at each number of workers."""
    workers: tuple[int, ...] = (1, 2)
    """Numbers of workers, or of RLlib's environment runners with --training (there 0: none, the
    process that learns plays as well)."""
    training: bool = False
    """Measure RLlib's PPO."""
    iterations: int = 5
    """Timed iterations of PPO; one more is not timed."""
    steps: int = 4_000
    """Control steps of the world in an iteration of PPO."""


def timed(*arguments: Any) -> Arrays:
    """Play a shard on a worker; return how much processor time it took, s."""
    began = time.process_time()
    arrays = play_on_worker(*arguments)
    return {**arrays, "cpu": np.array([time.process_time() - began])}


def on_cluster(settings: Settings, workers: int) -> dict[str, Any]:
    """Evaluate with so many workers; the clock starts when each has done a shard."""
    s = settings
    ray.init(num_cpus=workers, log_to_driver=False, logging_level="error", **_ALONE)
    try:
        with tempfile.TemporaryDirectory() as folder, RayBackend(Cluster()) as backend:
            cluster, store = Cluster(work=folder), Folder(folder)
            warm = _job(s, cluster, seed=1, episodes=cluster.worlds * 4 * workers)
            collect([warm], backend, store, Watcher())
            store.remove(warm)
            other, job = OtherWork(), _job(s, cluster, seed=7, episodes=s.episodes)
            began, own = time.perf_counter(), time.process_time()
            collect([job], backend, store, Watcher())
            seconds, own = time.perf_counter() - began, time.process_time() - own
            files = [path.stat().st_size for path in Path(folder).rglob("*.npz")]
            cpu = sum(float(part["cpu"][0]) for part in store.read(job))
            return {
                "workers": workers,
                "episodes_per_second": s.episodes / seconds,
                "episodes_per_core_second": s.episodes / cpu,
                "driver_core_seconds_per_shard": own / len(job.shards),
                "bytes_per_episode": sum(files) / s.episodes,
                "cores_of_others": other.cores(cpu + own),
            }
    finally:
        ray.shutdown()


def _job(s: Settings, cluster: Cluster, seed: int, episodes: int) -> Job:
    scenario = get_scenario(s.scenario)
    size = max(scenario.message_size, load(s.policy).message_size)
    fitted = scenario.replace(message_size=size)
    job = evaluation_job(s.policy, s.policy, fitted, episodes, seed, "test", cluster, None)
    return replace(job, function=timed)


def here(settings: Settings, threads: int) -> dict[str, Any]:
    """Evaluate without Ray."""
    s = settings
    evaluate(s.policy, s.scenario, 500, progress=False, num_threads=threads)
    other, began, cpu = OtherWork(), time.perf_counter(), time.process_time()
    evaluate(s.policy, s.scenario, s.episodes, progress=False, num_threads=threads)
    seconds, cpu = time.perf_counter() - began, time.process_time() - cpu
    return {
        "threads": threads,
        "episodes_per_second": s.episodes / seconds,
        "episodes_per_core_second": s.episodes / cpu,
        "cores_of_others": other.cores(cpu),
    }


def rllib(settings: Settings, runners: int) -> dict[str, Any]:
    """Train one policy for all trackers with RLlib's PPO; return control steps a second."""
    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.rllib.env.wrappers.pettingzoo_env import ParallelPettingZooEnv
    from ray.tune import register_env

    import posse

    ray.init(num_cpus=runners + 1, log_to_driver=False, logging_level="error", **_ALONE)
    register_env("posse", lambda s: ParallelPettingZooEnv(posse.parallel_env(settings.scenario)))
    config = PPOConfig().environment("posse").env_runners(num_env_runners=runners)
    config.multi_agent(policies={"tracker"}, policy_mapping_fn=lambda agent, _: "tracker")
    config.training(train_batch_size=settings.steps, minibatch_size=min(500, settings.steps), num_epochs=4)
    algorithm = config.build_algo()
    # RLlib's own timers are moving averages, in which the first iteration outweighs all others.
    learning, update = Stopwatch(), algorithm.learner_group.update
    algorithm.learner_group.update = learning.around(update)
    try:
        before, load = _steps(algorithm.train()), os.getloadavg()[0]
        began, learning.seconds = time.perf_counter(), 0.0
        for _ in range(settings.iterations):
            found = algorithm.train()
        seconds = time.perf_counter() - began
        return {
            "runners": runners,
            "steps_per_second": (_steps(found) - before) / seconds,
            "playing_s_per_iteration": (seconds - learning.seconds) / settings.iterations,
            "learning_s_per_iteration": learning.seconds / settings.iterations,
            "load_average": load,
        }
    finally:
        algorithm.stop()
        ray.shutdown()


class Stopwatch:
    """Adds up the time that calls of a function take, s."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def around(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function that is timed."""

        def timed_function(*arguments: Any, **named: Any) -> Any:
            began = time.perf_counter()
            try:
                return function(*arguments, **named)
            finally:
                self.seconds += time.perf_counter() - began

        return timed_function


def _steps(found: dict[str, Any]) -> float:
    """Return the control steps of all worlds so far."""
    return float(found["env_runners"]["num_env_steps_sampled_lifetime"])


def _table(rows: list[dict[str, Any]]) -> str:
    """Return rows as a table in Markdown; columns that a row lacks are empty."""
    columns = list(dict.fromkeys(name for row in rows for name in row))
    lines = [columns, ["---"] * len(columns)]
    lines += [[f"{row[c]:,.4g}" if c in row else "" for c in columns] for row in rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def main() -> None:
    """Measure, print and write the figures."""
    settings = tyro.cli(Settings)
    rows: list[dict[str, Any]] = []
    if not settings.training:
        rows += [here(settings, threads) for threads in settings.workers]
    for count in settings.workers:
        rows.append((rllib if settings.training else on_cluster)(settings, count))
    machine = describe()
    print(_table(rows))
    print("{processor}, {cores} cores, Python {python}, {date}, commit {commit}".format(**machine))
    OUT.parent.mkdir(parents=True, exist_ok=True)
    out = OUT.with_stem("cluster-training") if settings.training else OUT
    out.write_text(json.dumps({"machine": machine, "rows": rows}, indent=2) + "\n")


if __name__ == "__main__":
    main()
