"""posse: a batch of worlds of 5 trackers; the variant is the scenario."""

import os

import numpy as np
from serve import ACTION_SETS, Built, serve

import posse


def build(worlds: int, variant: str) -> Built:
    """Return a batch with one thread per available core."""
    batch = posse.batch(variant, worlds, seed=0, num_threads=len(os.sched_getaffinity(0)))
    draws = np.random.default_rng(0).uniform(-1, 1, (ACTION_SETS, *batch.action_shape))
    actions = draws.astype(np.float32)
    batch.reset()

    def run(steps: int) -> None:
        for k in range(steps):
            batch.step(actions[k % ACTION_SETS])

    return Built(run, batch.scenario.num_trackers, batch.layout.size)


serve(build, "numpy", "numba")
