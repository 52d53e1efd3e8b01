"""Start poses given to a reset, and their validation by the rules of a drawn start."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from posse.engine.arguments import real_numbers
from posse.numeric import BoolArray, Records, kernel
from posse.rules.start import is_clear, target_can_turn
from posse.rules.state import WorldArrays
from posse.scenarios import Scenario

Poses = dict[str, npt.NDArray[np.float64]]


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
        if name == "tracker_pose" and array.shape == (3,) and scenario.num_trackers == 1:
            array = array[None]
        if array.shape not in (shape, full):
            raise ValueError(f"{name} has shape {array.shape}, wanted {shape} or {full}: (x, y, θ) each")
        if not np.isfinite(array).all():
            raise ValueError(f"{name} must be finite, got {array[~np.isfinite(array)][0]}")
        most = scenario.start_extent
        if np.abs(array[..., :2]).max() > most:
            raise ValueError(
                f"{name} lies up to {np.abs(array[..., :2]).max():.4g} m from the origin, "
                f"starts of {scenario.name!r} lie within ±{most:g} m along each axis"
            )
        poses[name] = np.broadcast_to(array, full)
    return poses


def write_poses(records: Records, poses: npt.NDArray[np.float64], chosen: BoolArray) -> None:
    """Set the poses of robots in the chosen worlds."""
    x, y, heading = np.moveaxis(poses[chosen], -1, 0)
    records["x"][chosen], records["y"][chosen] = x, y
    records["heading_cos"][chosen], records["heading_sin"][chosen] = np.cos(heading), np.sin(heading)


@kernel
def first_overlap(config: Records, world: Records, tracker: Records, obstacle: Records) -> int:
    """Return ``e * (N + 1) + i`` of the first robot i that overlaps one before it, an obstacle or a wall; -1: none.

    The target is robot N.
    """
    c, n = config[0], tracker.shape[1]
    for e in range(len(world)):
        w, zero = world[e], np.float32(0)
        for i in range(n):
            t = tracker[e, i]
            if not is_clear(c, tracker[e], i, obstacle[e], t.x, t.y, zero):
                return int(e * (n + 1) + i)
        if not is_clear(c, tracker[e], n, obstacle[e], w.x, w.y, zero):
            return int(e * (n + 1) + n)
    return -1


@kernel
def first_stuck_target(config: Records, world: Records, obstacle: Records) -> int:
    """Return the first world whose scripted target has no room to turn; -1: none."""
    c = config[0]
    for e in range(len(world)):
        if c.target_speed > 0 and not target_can_turn(c, world[e], obstacle[e]):
            return e
    return -1


def check_poses(config: Records, arrays: WorldArrays, chosen: BoolArray, target_is_given: bool) -> None:
    """Raise ValueError if robots overlap each other, an obstacle or a wall, or the given target cannot turn."""
    world, tracker, obstacle = arrays.world[chosen], arrays.tracker[chosen], arrays.obstacle[chosen]
    found = first_overlap(config, world, tracker, obstacle)
    if found >= 0:
        e, i = divmod(found, tracker.shape[1] + 1)
        robot = "the target" if i == tracker.shape[1] else f"tracker_{i}"
        raise ValueError(
            f"{robot} of world {np.flatnonzero(chosen)[e]} would start in a wall, an obstacle or another robot: move it"
        )
    stuck = first_stuck_target(config, world, obstacle) if target_is_given else -1
    if stuck >= 0:
        x, y, turned = (float(world[name][stuck]) for name in ("x", "y", "heading_sin"))
        heading = math.atan2(turned, world["heading_cos"][stuck])
        radius = config["target_speed"][0] / config["target_turn_rate"][0] + config["safe_distance"][0]
        raise ValueError(
            f"target_pose ({x:.4g}, {y:.4g}, {heading:.4g}) leaves the target no room to turn: a disc of "
            f"{radius:.3g} m about the centre of its left or right turning circle must be clear of obstacles "
            "and walls: move it or turn it"
        )
