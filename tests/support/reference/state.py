"""The states of a batch and of one world, as complex numbers."""

from typing import Any

import numpy as np
import numpy.typing as npt

import posse

State = dict[str, npt.NDArray[Any]]
"""Every state array by name: of a batch, or (without the first axis) of one world."""
Array = npt.NDArray[np.float64]
Complexes = npt.NDArray[np.complex128]

NEVER = 2**30
NAMES = tuple(name for name in posse.scenario_names() if name != "robots")
"""The scenarios computed here: robots obey at once and know where they are. The other is in test_robots.py."""
TOUCHING = 0.001  # m, of free width


def snapshot(batch: posse.Batch) -> State:
    """Return a copy of every state array of a batch."""
    return {name: array.copy() for name, array in batch.state.items()}


def points(batch: posse.Batch, name: str, x: str = "x", y: str = "y") -> Complexes:
    """Return positions x + iy of the state array ``name``."""
    return np.asarray(batch.state[f"{name}_{x}"].astype(np.float64) + 1j * batch.state[f"{name}_{y}"])


def directions(batch: posse.Batch, name: str) -> Complexes:
    """Return headings cos θ + i sin θ of the state array ``name``."""
    return points(batch, name, "heading_cos", "heading_sin")


def one_world(state: State, e: int) -> State:
    return {name: array[e] for name, array in state.items()}


def positions(state: State, x: str = "x", y: str = "y") -> Complexes:
    """Return x + iy of the trackers and, last, of the target, (N + 1,)."""
    along, across = (np.append(state[f"tracker_{name}"], state[f"world_{name}"]) for name in (x, y))
    return np.asarray(along.astype(np.float64) + 1j * across)


def headings(state: State) -> Complexes:
    """Return cos θ + i sin θ of the trackers and, last, of the target, (N + 1,)."""
    return positions(state, "heading_cos", "heading_sin")


def obstacles(state: State) -> tuple[Complexes, Array]:
    x, y = state["obstacle_x"].astype(np.float64), state["obstacle_y"].astype(np.float64)
    return x + 1j * y, state["obstacle_radius"].astype(np.float64)


def working(state: State) -> npt.NDArray[np.bool_]:
    return np.asarray(state["tracker_broken_at"] == NEVER)
