"""Helpers of the tests of the GPU engine: games played on both devices."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

import posse

WORLDS: Final = 3

# Episodes short enough to end and start again, close enough to touch, in every scenario.
CASES: Final[dict[str, dict[str, Any]]] = {
    "smart": {"scenario": "smart", "horizon": 15, "start_distance": (0.6, 1.4)},
    "radio": {"scenario": "radio", "message_size": 2, "num_trackers": 3},
    "leader-loss": {"scenario": "leader-loss", "horizon": 10, "break_window": (0.2, 0.6)},
    "field": {"scenario": "field", "horizon": 18, "sensor_outages": 1.0, "radio_outages": 1.0},
    "crowd": {"scenario": "smart", "num_trackers": 10, "num_neighbours": 4, "message_size": 1},
    "many": {"scenario": "constant", "num_trackers": 11, "num_neighbours": 9},
    "target": {"scenario": "obstacles", "target_motion": "agent", "terminate_on_contact": True},
}
STEPS: Final = 24


def make(case: str, device: str, **settings: Any) -> posse.Batch:
    settings = {"settle_time": 0.2, **CASES[case], **settings}
    return posse.batch(num_worlds=WORLDS, seed=5, device=device, **settings)


def actions_for(batch: posse.Batch, step: int) -> npt.NDArray[np.float32]:
    """Actions at high speed, every other agent in circles, for many contacts."""
    rng = np.random.default_rng(step)
    actions = rng.uniform(-1.0, 1.0, batch.action_shape)
    actions[:, :, 0] = np.minimum(1.0, actions[:, :, 0] + 1.0)
    actions[:, ::2, 1] = 1.0
    return np.asarray(actions, np.float32)


def on_host(array: Any) -> npt.NDArray[Any]:
    return np.array(array if isinstance(array, np.ndarray) else array.copy_to_host())


def play(batch: posse.Batch) -> dict[str, npt.NDArray[Any]]:
    """Return all outputs of a batch over the steps, and its final state."""
    made: dict[str, list[npt.NDArray[Any]]] = {"observations": [on_host(batch.reset())]}
    ended = 0
    for step in range(STEPS):
        observations, rewards, terminated, truncated, infos = batch.step(actions_for(batch, step))
        given = {
            "observations": observations,
            "rewards": rewards,
            "terminated": terminated,
            "truncated": truncated,
            "score": infos["score"],
            **{f"reward_{name}": term for name, term in infos["reward_terms"].items()},
        }
        for name, array in given.items():
            made.setdefault(name, []).append(on_host(array))
        for name, metric in infos.get("metrics", {}).items():
            made.setdefault(f"metric_{name}", []).append(metric[infos["_metrics"]])
            ended += name == "score"
    return {
        **{name: np.concatenate(arrays) for name, arrays in made.items()},
        **{f"state_{name}": np.array(array) for name, array in batch.state.items()},
        "ended": np.array(ended),
    }


def run_in_simulator(tests: Path, **environment: str) -> None:
    """Run a file of tests with numba's simulator of a GPU in plain Python."""
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-p",
            "no:cacheprovider",
            # numpy warns about the integer overflow that the random draws use.
            "-W",
            "ignore:overflow encountered:RuntimeWarning",
            str(tests),
        ],
        env={**os.environ, "NUMBA_ENABLE_CUDASIM": "1", "NUMBA_DISABLE_JIT": "1", **environment},
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
