"""Plays the worlds of one version for ``paired.py``: reads cases from stdin, writes s/step.

Uses only what both versions offer: the root of the version's tree is the first argument.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

Step = Callable[[], object]
CHUNK = 1e-3  # s


def of_batch(case: dict[str, Any]) -> Step:
    """Return a step of a batch with random actions."""
    import posse

    batch = posse.batch(case["scenario"], case["worlds"], num_threads=case["threads"])
    batch.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1, 1, batch.action_shape).astype(np.float32)
    return lambda: batch.step(actions)


def of_pettingzoo(case: dict[str, Any]) -> Step:
    """Return a step of the PettingZoo environment."""
    import posse

    env = posse.parallel_env(case["scenario"])
    env.reset(seed=0)
    actions = {agent: np.full(2, 0.3, np.float32) for agent in env.agents}

    def step() -> None:
        env.step(actions)
        if not env.agents:
            env.reset()

    return step


def of_team(case: dict[str, Any]) -> Step:
    """Return a step of the Gymnasium environment of a team."""
    import gymnasium

    env: Any = gymnasium.make("posse/Team-v0", scenario=case["scenario"]).unwrapped
    env.reset(seed=0)
    actions = np.full(env.action_space.shape, 0.3, np.float32)

    def step() -> None:
        _, _, terminated, truncated, _ = env.step(actions)
        if terminated or truncated:
            env.reset()

    return step


KINDS: dict[str, Callable[[dict[str, Any]], Step]] = {"batch": of_batch, "pettingzoo": of_pettingzoo, "team": of_team}


def fastest(step: Step, seconds: float) -> float:
    """Return the least time of a step in a run, s, over chunks of a millisecond or more."""
    least, started = float("inf"), time.perf_counter()
    while (begun := time.perf_counter()) - started < seconds:
        count = 0
        while (took := time.perf_counter() - begun) < CHUNK:
            step()
            count += 1
        least = min(least, took / max(1, count))
    return least


def main() -> None:
    """Answer each line with the least time of a step."""
    root = sys.argv[1]
    sys.path[:0] = [f"{root}/envs", f"{root}/baselines", f"{root}/training"]
    playing: dict[str, Any] = {}
    step: Step = time.perf_counter
    for line in sys.stdin:
        asked = json.loads(line)
        if asked["case"] != playing:
            playing = asked["case"]
            step = KINDS[playing["kind"]](playing)
        print(fastest(step, asked["seconds"]), flush=True)


if __name__ == "__main__":
    main()
