"""How a scripted target moves: the three motions of the paper's section 2.

Each motion sets a goal heading; one steering law turns the target to it within its turn limit. In
an arena the goal is mirrored near walls, and a safeguard keeps the target from obstacles and walls
exactly: it only ever takes a turn that leaves one of its two turning circles free, so that it can
always go on turning for ever without touching anything.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from posse.arrays import Record, Records
from posse.compiled import compiled
from posse.kinematics import arc, turn_towards
from posse.randomness import TARGET, between, uniform

CONSTANT: Final = 0
ACCELERATING: Final = 1
SMART: Final = 2
AGENT: Final = 3

_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)
_HALF: Final = np.float32(0.5)
_TWO: Final = np.float32(2.0)
_TWO_PI: Final = np.float32(2 * math.pi)
_TINY: Final = np.float32(1e-12)
_SOFT_WALL: Final = np.float32(2.0)  # a goal heading is mirrored this far before a wall, m

_WEAVE_LEAST_RATE: Final = np.float32(0.2)  # rad/s
_WEAVE_MOST_RATE: Final = np.float32(0.8)
_WEAVE_LEAST: Final = np.float32(0.4)  # least and greatest turn, as shares of the limit
_WEAVE_MOST: Final = np.float32(0.9)

SMART_DIRECTIONS: Final = 16
SMART_REPLAN: Final = 3  # control steps between two plans
_DIRECTION_COS: Final = np.cos(2 * np.pi * np.arange(SMART_DIRECTIONS) / 16).astype(np.float32)
_DIRECTION_SIN: Final = np.sin(2 * np.pi * np.arange(SMART_DIRECTIONS) / 16).astype(np.float32)


@compiled
def draw_motion(c: Record, w: Record) -> None:
    """Draw what an episode's target motion depends on besides its start."""
    w.weave_amplitude, w.weave_rate, w.weave_phase = _ZERO, _ZERO, _ZERO
    if c.motion == ACCELERATING:
        limit = c.target_turn_rate
        w.weave_amplitude = between(_WEAVE_LEAST, _WEAVE_MOST, w.key, 0, TARGET, 100) * limit
        w.weave_rate = between(_WEAVE_LEAST_RATE, _WEAVE_MOST_RATE, w.key, 0, TARGET, 101)
        w.weave_phase = _TWO_PI * uniform(w.key, 0, TARGET, 102)


@compiled
def target_turn_rate(c: Record, w: Record, trackers: Records, obstacles: Records) -> np.float32:
    """Return the turn rate that a scripted target takes for the next control step, rad/s."""
    if c.motion == ACCELERATING:
        time = np.float32(w.step) * c.dt
        turn = w.weave_amplitude * np.float32(math.sin(w.weave_rate * time + w.weave_phase))
        _, _, w.goal_cos, w.goal_sin = arc(w.goal_cos, w.goal_sin, _ZERO, turn, c.dt)
    elif c.motion == SMART and w.step % SMART_REPLAN == 0:
        plan_escape(c, w, trackers, obstacles)
    if c.walled:
        mirror_at_walls(c, w)
    turn = turn_towards(
        w.heading_cos, w.heading_sin, w.goal_cos, w.goal_sin, c.target_turn_rate, c.dt
    )
    if c.walled:
        turn = safe_turn(c, w, obstacles, turn)
    return turn


@compiled
def plan_escape(c: Record, w: Record, trackers: Records, obstacles: Records) -> None:
    """Set the goal heading of a smart target: through the widest gap the team leaves.

    For every direction u, the soonest that any tracker, straight on at full speed, could be where
    the target then is: the least root t of |p - u v t| = V t. The target takes the direction where
    that is latest, seen from where the trackers will be shortly, and loath to turn.
    """
    v, most = c.target_speed, c.tracker_speed
    a = most * most - v * v
    best = np.float32(-1.0)
    for k in range(SMART_DIRECTIONS):
        ux, uy = _DIRECTION_COS[k], _DIRECTION_SIN[k]
        soonest = np.float32(1e9)
        for i in range(c.num_trackers):
            t = trackers[i]
            px = t.x + _HALF * t.speed * t.heading_cos - w.x
            py = t.y + _HALF * t.speed * t.heading_sin - w.y
            b = v * (px * ux + py * uy)
            d2 = px * px + py * py
            time = (np.float32(math.sqrt(b * b + a * d2)) - b) / a
            soonest = min(soonest, time)
        turn = _ONE - (ux * w.heading_cos + uy * w.heading_sin)
        value = soonest - _HALF * turn
        if value > best:
            best = value
            w.goal_cos, w.goal_sin = ux, uy


@compiled
def mirror_at_walls(c: Record, w: Record) -> None:
    """Mirror the goal heading at a wall that is near and ahead."""
    inner = max(c.half_arena - _SOFT_WALL, c.half_arena * _HALF)
    if (w.x > inner and w.goal_cos > _ZERO) or (w.x < -inner and w.goal_cos < _ZERO):
        w.goal_cos = -w.goal_cos
    if (w.y > inner and w.goal_sin > _ZERO) or (w.y < -inner and w.goal_sin < _ZERO):
        w.goal_sin = -w.goal_sin


@compiled
def circle_is_free(
    c: Record, obstacles: Records, x: np.float32, y: np.float32, radius: np.float32
) -> bool:
    """Say whether a disc of the target's turning circle, rim included, is clear of everything."""
    room = radius + c.safe_distance
    if abs(x) + room > c.half_arena or abs(y) + room > c.half_arena:
        return False
    for k in range(c.num_obstacles):
        o = obstacles[k]
        reach = room + o.radius
        # The disc may also surround the obstacle, but then the path along its rim is not safe
        # for every obstacle inside; a circle that holds one is not free.
        if (o.x - x) * (o.x - x) + (o.y - y) * (o.y - y) < reach * reach:
            return False
    return True


@compiled
def has_free_circle(
    c: Record,
    obstacles: Records,
    x: np.float32,
    y: np.float32,
    heading_cos: np.float32,
    heading_sin: np.float32,
    side: np.float32,
) -> bool:
    """Say whether the turning circle to one side (+1 left, -1 right) is free."""
    radius = c.target_speed / c.target_turn_rate
    return circle_is_free(
        c, obstacles, x - side * radius * heading_sin, y + side * radius * heading_cos, radius
    )


@compiled
def safe_turn(c: Record, w: Record, obstacles: Records, turn: np.float32) -> np.float32:
    """Return ``turn`` if a free turning circle remains after it, else the turn along a free one."""
    dx, dy, hc, hs = w.heading_cos, w.heading_sin, w.heading_cos, w.heading_sin
    x, y = w.x, w.y
    for _ in range(c.physics_steps):
        dx, dy, hc, hs = arc(hc, hs, c.target_speed, turn, c.physics_dt)
        x, y = x + dx, y + dy
    if has_free_circle(c, obstacles, x, y, hc, hs, _ONE):
        return turn
    if has_free_circle(c, obstacles, x, y, hc, hs, -_ONE):
        return turn
    side = _ONE
    left = has_free_circle(c, obstacles, w.x, w.y, w.heading_cos, w.heading_sin, _ONE)
    if not left and has_free_circle(
        c, obstacles, w.x, w.y, w.heading_cos, w.heading_sin, -_ONE
    ):
        side = -_ONE
    elif left and turn < _ZERO and has_free_circle(
        c, obstacles, w.x, w.y, w.heading_cos, w.heading_sin, -_ONE
    ):
        side = -_ONE
    return side * c.target_turn_rate
