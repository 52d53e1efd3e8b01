"""What a smart target weighs: every direction it could take, against where the trackers are."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from posse.numeric import (
    WIDTH,
    Record,
    Records,
    choose,
    compiled,
    eight,
    lesser,
    load,
    root,
    store,
)
from posse.rules.kinematics import arc
from posse.rules.state import NEVER
from posse.scenarios.formation import follow_heading

DART_TURN: Final = np.float32(1.3 * math.pi)
"""A dart lasts as long as turning so far, rad."""
SMART_DIRECTIONS: Final = 2 * WIDTH
"""That it weighs."""

_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)
_HALF: Final = np.float32(0.5)
_NO_BITS: Final = np.uint64(0)
_TINY: Final = np.float32(1e-12)
_HALF_ROUND: Final = WIDTH
_FORESIGHT: Final = np.float32(0.5)  # s; trackers are taken to be where they will be then
_LOYALTY: Final = np.float32(0.5)  # s; going back on its choice has to be worth twice that
_LOOKOUT: Final = np.float32(4.0)  # s; an obstacle or wall that is farther ahead does not matter
_DART_MOMENTS: Final = 6  # at which a dart is looked at beforehand
_DART_TURN_COS: Final = np.float32(math.cos(1.3 * math.pi / _DART_MOMENTS))  # between two of them
_DART_TURN_SIN: Final = np.float32(math.sin(1.3 * math.pi / _DART_MOMENTS))
_DART_STRIDE: Final = 2  # every second direction is played through
_CLEARANCE: Final = np.float32(0.3)  # m between the rims of the target and a tracker
_FAR: Final = np.float32(1e3)  # for a direction that nobody bars
_BLOCKED: Final = np.float32(100.0)  # m; what running into a tracker takes off a dart's worth

_ANGLES: Final = 2 * np.pi * np.arange(SMART_DIRECTIONS) / SMART_DIRECTIONS
_DIRECTION_COS: Final = np.cos(_ANGLES).astype(np.float32)
_DIRECTION_SIN: Final = np.sin(_ANGLES).astype(np.float32)


@compiled
def plan_escape(c: Record, w: Record, trackers: Records, obstacles: Records, s: Record) -> None:
    """Set the goal heading through the widest gap that the team leaves.

    For every direction u, the soonest that any tracker, straight on at full speed, could be where
    the target then is: the least root t of |p - u v t| = V t. The target takes the direction where
    that is latest, seen from where the trackers will be shortly, and does not go back on a choice
    for little: among trackers that surround it, it would dither.
    """
    v, most = c.target_speed, c.fastest
    a = most * most - v * v
    per_a = _ONE / a
    clear = c.radius + c.radius + _CLEARANCE
    # What it heads for at the start was not its choice, and one that ended in contact was bad.
    loyalty = _LOYALTY if w.step > 0 and w.touching == _NO_BITS else _ZERO
    # Half the directions and, astern, their opposites, which have the square root in common.
    ux, uy = load(_DIRECTION_COS, 0), load(_DIRECTION_SIN, 0)
    ahead, astern = eight(_FAR), eight(_FAR)
    for i in range(c.num_trackers):
        t = trackers[i]
        if t.broken_at != NEVER:
            # It goes nowhere, and is met only by running into it.
            px, py = t.x - w.x, t.y - w.y
            along, across = px * ux + py * uy, px * uy - py * ux
            met = (across < clear) & (across > -clear)
            along = along * (a / v)
            ahead = lesser(ahead, choose(met & (along > _ZERO), along, _FAR))
            astern = lesser(astern, choose(met & (along < _ZERO), _ZERO - along, _FAR))
        else:
            px = t.x + _FORESIGHT * t.speed * t.heading_cos - w.x
            py = t.y + _FORESIGHT * t.speed * t.heading_sin - w.y
            b = v * (px * ux + py * uy)
            until = root(b * b + a * (px * px + py * py))
            ahead, astern = lesser(ahead, until - b), lesser(astern, until + b)
    same_way = loyalty * (ux * w.goal_cos + uy * w.goal_sin)
    store(s.worth, 0, ahead * per_a + same_way)
    store(s.worth, _HALF_ROUND, astern * per_a - same_way)
    best = np.float32(-1e9)
    for k in range(_HALF_ROUND):
        ux, uy = _DIRECTION_COS[k], _DIRECTION_SIN[k]
        for side in range(2):
            value = s.worth[_HALF_ROUND * side + k]
            if c.walled and value + _LOOKOUT > best:
                value += free_time(c, w, obstacles, ux, uy)
            if value > best:
                best = value
                w.goal_cos, w.goal_sin = ux, uy
            ux, uy = -ux, -uy


@compiled(seldom=True)
def free_time(
    c: Record, w: Record, obstacles: Records, ux: np.float32, uy: np.float32
) -> np.float32:
    """Return for how long, at most ``_LOOKOUT``, a direction is free of obstacles and walls, s."""
    far = c.target_speed * _LOOKOUT
    inner = c.half_arena - c.safe_distance
    if abs(ux) > _TINY:
        far = min(far, (inner - w.x) / ux if ux > _ZERO else (-inner - w.x) / ux)
    if abs(uy) > _TINY:
        far = min(far, (inner - w.y) / uy if uy > _ZERO else (-inner - w.y) / uy)
    for k in range(c.num_obstacles):
        o = obstacles[k]
        ox, oy = o.x - w.x, o.y - w.y
        along, across = ox * ux + oy * uy, ox * uy - oy * ux
        reach = o.radius + c.safe_distance
        if along > _ZERO and abs(across) < reach:
            far = min(far, max(_ZERO, along - reach))
    return np.float32(far / c.target_speed)


@compiled(seldom=True)
def plan_dart(c: Record, w: Record, trackers: Records, obstacles: Records) -> None:
    """Set the goal heading whose turn tears the formation apart.

    Every direction is played through, the trackers holding the speed and turn rate that they have:
    the best one moves them farthest from where they stand around the target, and does not lead
    into one of them.
    """
    moment = DART_TURN / (c.target_turn_rate * np.float32(_DART_MOMENTS))
    clear = c.radius + c.radius + _CLEARANCE
    best = np.float32(-1e9)
    for k in range(0, SMART_DIRECTIONS, _DART_STRIDE):
        ux, uy = _DIRECTION_COS[k], _DIRECTION_SIN[k]
        value = _ZERO
        for i in range(c.num_trackers):
            t = trackers[i]
            hc, hs, tc, ts = w.heading_cos, w.heading_sin, t.heading_cos, t.heading_sin
            moved_x, moved_y = _ZERO, _ZERO  # by how much, seen from the target
            for _ in range(_DART_MOMENTS):
                old_c, old_s = hc, hs
                hc, hs = follow_heading(hc, hs, ux, uy, _DART_TURN_COS, _DART_TURN_SIN)
                dx, dy, tc, ts = arc(tc, ts, t.speed, t.turn_rate, moment)
                moved_x += dx - _HALF * c.target_speed * moment * (old_c + hc)
                moved_y += dy - _HALF * c.target_speed * moment * (old_s + hs)
                x, y = t.x - w.x + moved_x, t.y - w.y + moved_y
                if x * x + y * y < clear * clear:
                    value -= _BLOCKED
            if t.broken_at == NEVER:
                value += np.float32(math.sqrt(moved_x * moved_x + moved_y * moved_y))
        if c.walled:
            value += free_time(c, w, obstacles, ux, uy)
        if value > best:
            best = value
            w.goal_cos, w.goal_sin = ux, uy
