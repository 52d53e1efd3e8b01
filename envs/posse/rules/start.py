"""How an episode starts: obstacles, the target, the trackers, each drawn clear of the others.

Places are drawn until one is clear. The scenario's checks leave room enough that the number of
tries below is never used up.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from posse.numeric import Record, Records, compiled
from posse.rules.faults import draw_faults
from posse.rules.randomness import OBSTACLES, START, between, episode_key, uniform
from posse.rules.targets.walls import has_free_circle
from posse.scenarios.limits import START_CLEARANCE

_TRIES: Final = 2000
_TWO_PI: Final = np.float32(2 * math.pi)
_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)
_CLEARANCE: Final = np.float32(START_CLEARANCE)
_ROUNDING: Final = np.float32(1e-3)  # m; a given pose is rounded to float32
_TRACKER_DRAWS: Final = 3 * _TRIES  # of the stream START; the target's come first


@compiled
def is_clear(
    c: Record,
    trackers: Records,
    placed: int,
    obstacles: Records,
    x: np.float32,
    y: np.float32,
    clearance: np.float32 = _CLEARANCE,
) -> bool:
    """Return whether a robot at (x, y) is clear of walls, obstacles and the first ``placed`` trackers."""
    if c.walled:
        inner = c.half_arena - c.radius - clearance
        if abs(x) > inner or abs(y) > inner:
            return False
    for k in range(c.num_obstacles):
        o = obstacles[k]
        reach = o.radius + c.radius + clearance
        if (o.x - x) * (o.x - x) + (o.y - y) * (o.y - y) < reach * reach:
            return False
    reach = c.radius + c.radius + clearance
    for j in range(placed):
        t = trackers[j]
        if (t.x - x) * (t.x - x) + (t.y - y) * (t.y - y) < reach * reach:
            return False
    return True


@compiled
def target_can_turn(c: Record, w: Record, obstacles: Records, allowance: np.float32 = _ROUNDING) -> bool:
    """Return whether a turning circle of a scripted target in an arena is free, but for an allowance, m."""
    if not c.walled or c.target_agent != 0:
        return True
    left = has_free_circle(c, obstacles, w.x, w.y, w.heading_cos, w.heading_sin, _ONE, allowance)
    right = has_free_circle(c, obstacles, w.x, w.y, w.heading_cos, w.heading_sin, -_ONE, allowance)
    return bool(left or right)


@compiled
def draw_obstacles(c: Record, w: Record, obstacles: Records) -> None:
    """Draw the obstacles, ``obstacle_gap`` apart and clear of the walls."""
    index = 0
    for k in range(c.num_obstacles):
        o = obstacles[k]
        o.radius = between(c.obstacle_least, c.obstacle_most, w.key, 0, OBSTACLES, index)
        room = c.half_arena - o.radius - c.obstacle_gap
        for _ in range(_TRIES):
            o.x = between(-room, room, w.key, 0, OBSTACLES, index + 1)
            o.y = between(-room, room, w.key, 0, OBSTACLES, index + 2)
            index += 3
            clear = True
            for j in range(k):
                p = obstacles[j]
                reach = o.radius + p.radius + c.obstacle_gap
                if (o.x - p.x) * (o.x - p.x) + (o.y - p.y) * (o.y - p.y) < reach * reach:
                    clear = False
            if clear:
                break


@compiled
def draw_target(c: Record, w: Record, obstacles: Records) -> None:
    """Draw the target's pose; a scripted one gets room to turn away from what is near."""
    for k in range(_TRIES):
        w.x = between(-c.target_extent, c.target_extent, w.key, 0, START, 3 * k)
        w.y = between(-c.target_extent, c.target_extent, w.key, 0, START, 3 * k + 1)
        heading = _TWO_PI * uniform(w.key, 0, START, 3 * k + 2)
        w.heading_cos = np.float32(math.cos(heading))
        w.heading_sin = np.float32(math.sin(heading))
        clear = True
        for j in range(c.num_obstacles):
            o = obstacles[j]
            reach = o.radius + c.radius + _CLEARANCE
            if (o.x - w.x) * (o.x - w.x) + (o.y - w.y) * (o.y - w.y) < reach * reach:
                clear = False
        if clear and target_can_turn(c, w, obstacles, _ZERO):
            break


@compiled
def draw_trackers(c: Record, w: Record, trackers: Records, obstacles: Records) -> None:
    """Draw the trackers' poses round the target, uniform in distance, bearing and heading."""
    index = _TRACKER_DRAWS
    for i in range(c.num_trackers):
        t = trackers[i]
        for _ in range(_TRIES):
            distance = between(c.start_least, c.start_most, w.key, 0, START, index)
            bearing = _TWO_PI * uniform(w.key, 0, START, index + 1)
            index += 2
            t.x = w.x + distance * np.float32(math.cos(bearing))
            t.y = w.y + distance * np.float32(math.sin(bearing))
            if is_clear(c, trackers, i, obstacles, t.x, t.y):
                break
        heading = _TWO_PI * uniform(w.key, 0, START, index)
        index += 1
        t.heading_cos = np.float32(math.cos(heading))
        t.heading_sin = np.float32(math.sin(heading))


@compiled
def rest(c: Record, w: Record, trackers: Records) -> None:
    """Set everything that does not depend on a draw to what it is when an episode starts.

    But for the sums behind the metrics.
    """
    w.step, w.over, w.terminated, w.held = 0, 0, 0, 0
    w.speed = c.target_speed if c.target_agent == 0 else _ZERO
    w.turn_rate = _ZERO
    w.frame_cos, w.frame_sin = w.heading_cos, w.heading_sin
    w.goal_cos, w.goal_sin = w.heading_cos, w.heading_sin
    w.touching = np.uint64(0)
    w.working = c.num_trackers
    w.score = _ZERO
    w.settled_at, w.detected_at, w.lost_at, w.recovered_at = -1, -1, -1, -1
    w.contacts_tracker, w.contacts_obstacle, w.contacts_target = 0, 0, 0
    w.least_gap = np.float32(1e6)
    for i in range(c.num_trackers):
        t = trackers[i]
        t.speed, t.turn_rate = _ZERO, _ZERO
        t.sees, t.touching, t.onsets = 0, 0, 0
        t.touching_trackers, t.touching_obstacles = np.uint64(0), np.uint64(0)
        t.fix_step = -1
        t.fix_x, t.fix_y, t.fix_vx, t.fix_vy = _ZERO, _ZERO, _ZERO, _ZERO
        t.fix_cos, t.fix_sin = _ONE, _ZERO
        t.fix_frame_cos, t.fix_frame_sin = _ONE, _ZERO
        t.slot, t.could_arrive = -1, 0
        t.slot_distance, t.slot_progress = _ZERO, _ZERO
        t.start_x, t.start_y = t.x, t.y


@compiled(seldom=True)
def draw_start(c: Record, w: Record, trackers: Records, obstacles: Records, draw_motion: Any) -> None:
    """Draw the next episode of a world: place, poses, motion, faults."""
    w.key = episode_key(w.seed, w.split, w.index, w.episode)
    draw_obstacles(c, w, obstacles)
    draw_target(c, w, obstacles)
    draw_trackers(c, w, trackers, obstacles)
    draw_motion(c, w)
    draw_faults(c, w, trackers)
