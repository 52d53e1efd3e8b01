"""How an episode starts: obstacles, the target, the trackers, each drawn clear of the others.

Places are drawn until one is clear. What finds none in so many tries is noted in the world
(``undrawn``), and :func:`check_drawn` raises.
"""

import math
from collections.abc import Container
from typing import Any, Final

import numpy as np

from posse.numeric import ONE, ZERO, BoolArray, Record, Records, compiled
from posse.rules.discs import obstacle_within, surroundings_within
from posse.rules.faults import draw_faults
from posse.rules.randomness import OBSTACLES, START, TWO_PI, between, episode_key, uniform
from posse.rules.state import WorldArrays
from posse.rules.targets.steering import ROUNDING, free_circles
from posse.scenarios import Scenario, ScenarioError

_TRIES: Final = 2000
_CLEARANCE: Final = np.float32(0.2)  # m, least between robots, and between a robot and an obstacle
_OBSTACLES: Final = 1
_TARGET: Final = 2
_TRACKERS: Final = 4
"""Bits of ``undrawn``."""
_TRACKER_DRAWS: Final = 3 * _TRIES  # of the stream START; the target's come first


@compiled
def is_clear(
    c: Record, others: Records, obstacles: Records, x: np.float32, y: np.float32, clearance: np.float32 = _CLEARANCE
) -> bool:
    """Return whether a robot at (x, y) is clear of walls, obstacles and other trackers."""
    if surroundings_within(c, obstacles, x, y, c.robot_radius + clearance):
        return False
    reach = c.robot_radius + c.robot_radius + clearance
    for t in others:
        dx, dy = t.x - x, t.y - y
        if dx * dx + dy * dy < reach * reach:
            return False
    return True


@compiled
def target_can_turn(c: Record, w: Record, obstacles: Records, allowance: np.float32 = ROUNDING) -> bool:
    """Return whether a turning circle of a scripted target in an arena is free, but for an allowance, m."""
    if not c.walled or c.target_is_agent:
        return True
    left, right = free_circles(c, obstacles, w.x, w.y, w.heading_cos, w.heading_sin, allowance)
    return bool(left or right)


@compiled
def draw_obstacles(c: Record, w: Record, obstacles: Records) -> None:
    """Draw the obstacles, ``obstacle_gap`` apart and clear of the walls."""
    index, clear = 0, True
    for k, o in enumerate(obstacles):
        o.radius = between(c.obstacle_radius_least, c.obstacle_radius_most, w.key, 0, OBSTACLES, index)
        room_x, room_y = c.half_width - o.radius - c.obstacle_gap, c.half_height - o.radius - c.obstacle_gap
        for _ in range(_TRIES if clear else 0):
            o.x = between(-room_x, room_x, w.key, 0, OBSTACLES, index + 1)
            o.y = between(-room_y, room_y, w.key, 0, OBSTACLES, index + 2)
            index += 3
            clear = min(room_x, room_y) > ZERO
            clear = clear and not obstacle_within(obstacles[:k], o.x, o.y, o.radius + c.obstacle_gap)
            if clear:
                break
    if not clear:
        w.undrawn |= _OBSTACLES


@compiled
def draw_target(c: Record, w: Record, obstacles: Records) -> None:
    """Draw the target's pose; a scripted one gets room to turn away from what is near."""
    for k in range(_TRIES):
        w.x = between(-c.target_extent_x, c.target_extent_x, w.key, 0, START, 3 * k)
        w.y = between(-c.target_extent_y, c.target_extent_y, w.key, 0, START, 3 * k + 1)
        heading = TWO_PI * uniform(w.key, 0, START, 3 * k + 2)
        w.heading_cos = np.float32(math.cos(heading))
        w.heading_sin = np.float32(math.sin(heading))
        clear = not obstacle_within(obstacles, w.x, w.y, c.robot_radius + _CLEARANCE)
        if clear and target_can_turn(c, w, obstacles, ZERO):
            return
    w.undrawn |= _TARGET


@compiled
def draw_trackers(c: Record, w: Record, trackers: Records, obstacles: Records) -> None:
    """Draw the trackers' poses round the target, uniform in distance, bearing and heading."""
    index, clear = _TRACKER_DRAWS, True
    for i, t in enumerate(trackers):
        for _ in range(_TRIES if clear else 0):
            distance = between(c.start_distance_least, c.start_distance_most, w.key, 0, START, index)
            bearing = TWO_PI * uniform(w.key, 0, START, index + 1)
            index += 2
            t.x = w.x + distance * np.float32(math.cos(bearing))
            t.y = w.y + distance * np.float32(math.sin(bearing))
            clear = is_clear(c, trackers[:i], obstacles, t.x, t.y)
            if clear:
                break
        heading = TWO_PI * uniform(w.key, 0, START, index)
        index += 1
        t.heading_cos = np.float32(math.cos(heading))
        t.heading_sin = np.float32(math.sin(heading))
    if not clear:
        w.undrawn |= _TRACKERS


@compiled
def begin(c: Record, worlds: WorldArrays, e: int) -> None:
    """Reset world e to the start of an episode, but for poses, faults, score and sums of metrics."""
    w, trackers = worlds.world[e], worlds.tracker[e]
    worlds.heard[e]["step"][:] = -1
    worlds.heard_message[e][:] = ZERO
    worlds.message[e][:] = ZERO
    worlds.broadcast[e]["sent"][:] = 0
    worlds.command[e][:, :, 0] = -ONE
    worlds.command[e][:, :, 1] = ZERO
    if c.drifts:
        for i in range(c.num_trackers):
            o = worlds.odometry[e, i]
            o.x, o.y, o.heading, o.cos, o.sin = ZERO, ZERO, ZERO, ONE, ZERO
    w.step, w.over, w.terminated = 0, 0, 0
    w.speed = ZERO if c.target_is_agent else c.target_speed
    w.turn_rate = ZERO
    w.frame_cos, w.frame_sin = w.heading_cos, w.heading_sin
    w.goal_cos, w.goal_sin = w.heading_cos, w.heading_sin
    w.touching = np.uint64(0)
    w.working = c.num_trackers
    w.settled_at, w.detected_at, w.lost_at, w.recovered_at = -1, -1, -1, -1
    w.contacts_tracker, w.contacts_obstacle, w.contacts_target = 0, 0, 0
    w.least_gap = np.float32(1e6)
    for t in trackers:
        t.speed, t.turn_rate = ZERO, ZERO
        t.sees, t.touching, t.onsets = 0, 0, 0
        t.touching_trackers, t.touching_obstacles = np.uint64(0), np.uint64(0)
        t.fix_step = -1
        t.fix.x, t.fix.y, t.fix.vx, t.fix.vy = ZERO, ZERO, ZERO, ZERO
        t.fix.cos, t.fix.sin, t.fix.frame_cos, t.fix.frame_sin = ONE, ZERO, ONE, ZERO
        t.slot, t.could_arrive = -1, 0
        t.slot_distance, t.slot_progress = ZERO, ZERO
        t.start_x, t.start_y = t.x, t.y


@compiled
def draw_start(c: Record, w: Record, trackers: Records, obstacles: Records, begin_motion: Any) -> None:
    """Draw the next episode of a world: place, poses, motion, faults."""
    w.key = episode_key(w.seed, w.split, w.index, w.episode)
    w.undrawn = 0
    draw_obstacles(c, w, obstacles)
    draw_target(c, w, obstacles)
    draw_trackers(c, w, trackers, obstacles)
    begin_motion(c, w)
    draw_faults(c, w, trackers)


def check_drawn(s: Scenario, world: Records, started: BoolArray, given: Container[str] = ()) -> None:
    """Raise ScenarioError if the start of any ``started`` world could not be drawn, but for poses that are given."""
    undrawn = int(np.bitwise_or.reduce(world["undrawn"][started]))
    if undrawn == 0:
        return
    walls = f" in arena={s.arena}" if s.walled else ""
    enlarge = ", or enlarge arena" if walls else ""
    if undrawn & _OBSTACLES:
        raise ScenarioError(
            f"could not place num_obstacles={s.num_obstacles} of obstacle_radius={s.obstacle_radius} with "
            f"obstacle_gap={s.obstacle_gap:g}{walls}: lower their number, radius or gap{enlarge}"
        )
    if undrawn & _TARGET and "target_pose" not in given:
        raise ScenarioError(
            f"could not place the target{walls} with room to turn between num_obstacles={s.num_obstacles}: lower "
            f"num_obstacles or target_speed={s.target_speed:g}, raise target_turn_rate={s.target_turn_rate:g}{enlarge}"
        )
    if undrawn & _TRACKERS and "tracker_pose" not in given:
        raise ScenarioError(
            f"could not place num_trackers={s.num_trackers} at start_distance={s.start_distance} of the "
            f"target{walls}: widen start_distance, lower num_trackers or robot_radius={s.robot_radius:g}{enlarge}"
        )
