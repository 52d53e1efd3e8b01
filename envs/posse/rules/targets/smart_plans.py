"""Plans of a smart target: evaluation of candidate directions."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from posse.numeric import WIDTH, Record, Records, choose, compiled, eight, lesser, load, root, store
from posse.rules.kinematics import arc
from posse.rules.state import NEVER
from posse.scenarios.formation import follow_heading

DART_TURN: Final = np.float32(1.3 * math.pi)
"""A dart lasts as long as a turn by this angle, rad."""
SMART_DIRECTIONS: Final = 2 * WIDTH
"""Number of candidate directions."""

_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)
_HALF: Final = np.float32(0.5)
_NO_BITS: Final = np.uint64(0)
_TINY: Final = np.float32(1e-12)
_HALF_ROUND: Final = WIDTH
_FORESIGHT: Final = np.float32(0.5)  # s; positions of trackers are predicted by this time
_LOYALTY: Final = np.float32(0.5)  # s; reversing a choice must gain twice this
_LOOKOUT: Final = np.float32(4.0)  # s; obstacles and walls farther ahead are ignored
_DART_MOMENTS: Final = 6  # time samples of a simulated dart
_DART_TURN_COS: Final = np.float32(math.cos(1.3 * math.pi / _DART_MOMENTS))  # between two of them
_DART_TURN_SIN: Final = np.float32(math.sin(1.3 * math.pi / _DART_MOMENTS))
_DART_STRIDE: Final = 2  # every second direction is simulated
_CLEARANCE: Final = np.float32(0.3)  # m between the rims of the target and a tracker
_FAR: Final = np.float32(1e3)  # for an unblocked direction
_BLOCKED: Final = np.float32(100.0)  # m; penalty of a dart for a collision

_ANGLES: Final = 2 * np.pi * np.arange(SMART_DIRECTIONS) / SMART_DIRECTIONS
_DIRECTION_COS: Final = np.cos(_ANGLES).astype(np.float32)
_DIRECTION_SIN: Final = np.sin(_ANGLES).astype(np.float32)


@compiled
def plan_escape(c: Record, w: Record, trackers: Records, obstacles: Records, s: Record) -> None:
    """Set the goal heading through the widest gap that the team leaves.

    For every direction u, the earliest interception by any tracker moving straight at full speed is
    the least root t of |p - u v t| = V t, with predicted positions of the trackers. The target
    takes the direction with the latest interception, with hysteresis against oscillation.
    """
    v, most = c.target_speed, c.fastest
    a = most * most - v * v
    per_a = _ONE / a
    clear = c.radius + c.radius + _CLEARANCE
    # No hysteresis for the initial heading, nor for a choice that ended in contact.
    loyalty = _LOYALTY if w.step > 0 and w.touching == _NO_BITS else _ZERO
    # Half the directions; the opposite ones share the square root.
    ux, uy = load(_DIRECTION_COS, 0), load(_DIRECTION_SIN, 0)
    ahead, astern = eight(_FAR), eight(_FAR)
    for i in range(c.num_trackers):
        t = trackers[i]
        if t.broken_at != NEVER:
            # A broken tracker is only an obstacle.
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
def free_time(c: Record, w: Record, obstacles: Records, ux: np.float32, uy: np.float32) -> np.float32:
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
    """Set the goal heading whose turn disrupts the formation most.

    Candidate directions are simulated with the trackers holding speed and turn rate: the best one
    displaces them farthest from their places around the target, without a collision.
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
            moved_x, moved_y = _ZERO, _ZERO  # displacement relative to the target
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
