"""The states of a batch and of one world, as complex numbers; motion on arcs, and free widths along them."""

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


def on_arc(place: complex, heading: complex, speed: float, turn_rate: float, time: float) -> tuple[complex, complex]:
    """Return position and heading after a time on the circle of (V, ω)."""
    turned = heading * np.exp(1j * turn_rate * time)
    if abs(turn_rate * time) < 1e-12:
        return place + speed * time * heading, turned
    # For a small turn the circle's centre is so far away that the difference of two points
    # relative to it is dominated by rounding.
    return place + heading * speed * np.expm1(1j * turn_rate * time) / (1j * turn_rate), turned


def free_motion(
    s: posse.Scenario, before: State, after: State, actions: npt.NDArray[Any]
) -> tuple[Complexes, Complexes, Array]:
    """Return all positions and headings after a step without contacts.

    And the speed and turn rate of the trackers, (2, N). What a scripted target decided is read off ``after``.
    """
    n, count = s.num_trackers, s.physics_steps
    dt = s.control_step / count
    place, heading = positions(before), headings(before)
    speeds = np.append(before["tracker_speed"], after["world_speed"]).astype(np.float64)
    turns = np.append(before["tracker_turn_rate"], after["world_turn_rate"]).astype(np.float64)
    if s.target_motion == "agent":
        speeds[n] = (float(actions[n, 0]) + 1) / 2 * s.target_speed
        turns[n] = float(actions[n, 1]) * s.target_turn_rate
    wanted, faster = (actions[:n, 0].astype(np.float64) + 1) / 2 * s.tracker_speeds, s.tracker_acceleration * dt
    turning, sooner = actions[:n, 1].astype(np.float64) * s.tracker_turn_rates, s.tracker_turn_acceleration * dt
    for _ in range(count):
        speeds[:n] = np.clip(wanted, speeds[:n] - faster, speeds[:n] + faster) * working(after)
        turns[:n] = np.clip(turning, turns[:n] - sooner, turns[:n] + sooner) * working(after)
        for i in range(n + 1):
            place[i], heading[i] = on_arc(place[i], heading[i], speeds[i], turns[i], dt)
    return place, heading, np.stack([speeds[:n], turns[:n]])


def free_gaps(s: posse.Scenario, state: State) -> Array:
    """Return the clearance between every tracker and everything else, (N, N + 1 + M + 4), m.

    The others: the trackers (its own place holds inf), the target, the obstacles, the walls.
    """
    p, n = positions(state), s.num_trackers
    mates = np.abs(p[:n, None] - p[None, :]) - 2 * s.robot_radius
    mates[np.arange(n), np.arange(n)] = np.inf
    centres, radii = obstacles(state)
    discs = np.abs(p[:n, None] - centres[None, :]) - radii - s.robot_radius
    inner_x, inner_y = (half - s.robot_radius for half in s.half_sides)
    x, y = p[:n].real, p[:n].imag
    walls = np.stack([inner_x - x, inner_x + x, inner_y - y, inner_y + y], axis=1)
    return np.concatenate([mates, discs, walls], axis=1)


def path_gaps(s: posse.Scenario, before: State, after: State, freely: Complexes) -> Array:
    """Return a lower bound of every robot's clearance during a step, (N + 1,), m."""
    start, end = positions(before), positions(after)
    centres, radii = obstacles(before)
    way = np.maximum(np.abs(freely - start), np.abs(end - start))
    robots = np.abs(start[:, None] - start) - way - 2 * s.robot_radius
    np.fill_diagonal(robots, np.inf)
    discs = np.abs(start[:, None] - centres) - radii - s.robot_radius
    walls = np.array(s.half_sides) - np.abs(np.stack([start.real, start.imag], axis=1)) - s.robot_radius
    return np.asarray(np.concatenate([robots, discs, walls], axis=1).min(axis=1) - way)
