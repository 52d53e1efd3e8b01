"""Start poses given to a reset, and their validation."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from posse.engine.arguments import real_numbers
from posse.numeric import BoolArray, Records
from posse.rules.state import WorldArrays
from posse.scenarios import Scenario
from posse.scenarios.limits import SAFE_MARGIN

Poses = dict[str, npt.NDArray[np.float64]]

_ROUNDING: Final = 1e-3
"""Tolerance of the room for a turning circle, m, since the pose is rounded to float32."""


def poses_of(options: Mapping[str, Any], scenario: Scenario, num_worlds: int) -> Poses:
    """Return the start poses among the options of a reset, (E, N, 3) and (E, 3).

    Raises:
        ValueError: A wrong type or shape, not finite, or outside the start area.
    """
    poses = {}
    for name, shape in (("tracker_pose", (scenario.num_trackers, 3)), ("target_pose", (3,))):
        if options.get(name) is None:
            continue
        full = (num_worlds, *shape)
        array = real_numbers(name, options[name]).astype(np.float64)
        if array.shape not in (shape, full):
            raise ValueError(f"{name} has shape {array.shape}, wanted {shape} or {full}: (x, y, θ) each")
        if not np.isfinite(array).all():
            raise ValueError(f"{name} must be finite, got {array[~np.isfinite(array)][0]}")
        most = scenario.start_extent
        if np.abs(array[..., :2]).max(initial=0) > most:
            raise ValueError(
                f"{name} lies up to {np.abs(array[..., :2]).max():.4g} m from the origin, "
                f"starts of {scenario.name!r} lie within ±{most:g} m along each axis"
            )
        poses[name] = np.broadcast_to(array, full)
    return poses


def check_overlap(s: Scenario, arrays: WorldArrays, chosen: BoolArray) -> None:
    """Raise ValueError if robots overlap each other, an obstacle or a wall."""
    world, tracker = arrays.world, arrays.tracker
    robots = np.stack(
        [np.concatenate([tracker[k], world[k][:, None]], axis=1)[chosen] for k in ("x", "y")], axis=-1
    ).astype(np.float64)
    names = [*(f"tracker_{i}" for i in range(s.num_trackers)), "the target"]
    apart = np.linalg.norm(robots[:, :, None] - robots[:, None], axis=-1)
    apart[:, np.arange(len(names)), np.arange(len(names))] = np.inf
    if apart.size and apart.min() <= 2 * s.robot_radius:
        _, i, j = np.unravel_index(apart.argmin(), apart.shape)
        raise ValueError(
            f"{names[i]} and {names[j]} would start {apart.min():.3g} m apart, discs of "
            f"robot_radius={s.robot_radius:g} overlap: move one"
        )
    if math.isfinite(s.arena) and chosen.any():
        room = s.arena / 2 - s.robot_radius - np.abs(robots).max(axis=(0, 2))
        if room.min() <= 0:
            raise ValueError(f"{names[int(room.argmin())]} would start in a wall: move it")
    obstacle = arrays.obstacle[chosen]
    for i, name in enumerate(names):
        dx = obstacle["x"] - robots[:, i, :1]
        dy = obstacle["y"] - robots[:, i, 1:]
        if (np.hypot(dx, dy) <= obstacle["radius"] + s.robot_radius).any():
            raise ValueError(f"{name} would start in an obstacle: move it")


def check_room_to_turn(s: Scenario, arrays: WorldArrays, chosen: BoolArray) -> None:
    """Raise ValueError if neither turning circle of a scripted target is free."""
    world, obstacle = arrays.world[chosen], arrays.obstacle
    if math.isinf(s.arena) or s.target_motion == "agent" or s.target_speed == 0 or not len(world):
        return
    radius = s.target_speed / s.target_turn_rate
    needed = radius + s.robot_radius + SAFE_MARGIN
    x, y = world["x"].astype(np.float64), world["y"].astype(np.float64)
    room = np.full(len(world), -np.inf)
    for side in (radius, -radius):
        centre_x, centre_y = x - side * world["heading_sin"], y + side * world["heading_cos"]
        free = s.arena / 2 - np.maximum(np.abs(centre_x), np.abs(centre_y))
        for o in obstacle[chosen].T:
            away = np.hypot(o["x"] - centre_x, o["y"] - centre_y) - o["radius"]
            free = np.minimum(free, away)
        room = np.maximum(room, free)
    if (room < needed - _ROUNDING).any():
        e = int(room.argmin())
        heading = math.atan2(world["heading_sin"][e], world["heading_cos"][e])
        raise ValueError(
            f"target_pose ({x[e]:.4g}, {y[e]:.4g}, {heading:.4g}) leaves the target no room to "
            f"turn: a disc of {needed:.3g} m about the centre of its left or right turning "
            f"circle must be clear of obstacles and walls, {max(0.0, room[e]):.3g} m are: move "
            "it or turn it"
        )


def write_poses(records: Records, poses: npt.NDArray[np.float64], chosen: BoolArray) -> None:
    """Set the poses of robots in the chosen worlds."""
    records["x"][chosen] = poses[chosen][..., 0]
    records["y"][chosen] = poses[chosen][..., 1]
    records["heading_cos"][chosen] = np.cos(poses[chosen][..., 2])
    records["heading_sin"][chosen] = np.sin(poses[chosen][..., 2])
