"""Contact: a disc never passes into or through another, however fast it moves.

Robots move one after the other, target first. Each move is swept along the chord of its arc and
stops where the disc would meet another disc or a wall; a robot so blocked stands still until it
heads elsewhere. A contact is counted once, when it begins, and by kind.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from posse.arrays import Record, Records
from posse.compiled import compiled

BLOCKING_GAP: Final = np.float32(0.0005)
"""Width of the gap at which a move stops, m."""
TOUCHING_GAP: Final = np.float32(0.001)
"""Robots nearer than this touch, m."""

_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)
_TWO: Final = np.float32(2.0)
_BIT: Final = np.uint64(1)
_NO_BITS: Final = np.uint64(0)
_FIRST_WALL: Final = 60


@compiled
def free_share(
    x: np.float32,
    y: np.float32,
    dx: np.float32,
    dy: np.float32,
    other_x: np.float32,
    other_y: np.float32,
    reach: np.float32,
) -> np.float32:
    """Return which share of a straight move, 0 to 1, a point makes before it is ``reach`` away."""
    rx, ry = x - other_x, y - other_y
    closing = rx * dx + ry * dy
    if closing >= _ZERO:
        return _ONE
    gap = rx * rx + ry * ry - reach * reach
    if gap <= _ZERO:
        return _ZERO
    length = dx * dx + dy * dy
    under_root = closing * closing - length * gap
    if under_root <= _ZERO:
        return _ONE
    return min(_ONE, (-closing - np.float32(math.sqrt(under_root))) / length)


@compiled
def free_share_wall(x: np.float32, dx: np.float32, bound: np.float32) -> np.float32:
    """Return which share of a move along one axis stays within ±bound."""
    if dx > _ZERO and x + dx > bound:
        return max(_ZERO, (bound - x) / dx)
    if dx < _ZERO and x + dx < -bound:
        return max(_ZERO, (-bound - x) / dx)
    return _ONE


@compiled
def free_move(
    c: Record,
    w: Record,
    trackers: Records,
    obstacles: Records,
    mover: int,
    x: np.float32,
    y: np.float32,
    dx: np.float32,
    dy: np.float32,
) -> np.float32:
    """Return the share of a robot's move that nothing blocks; mover -1 is the target."""
    share = _ONE
    reach = c.radius + c.radius + BLOCKING_GAP
    for j in range(c.num_trackers):
        if j != mover:
            other = trackers[j]
            share = min(share, free_share(x, y, dx, dy, other.x, other.y, reach))
    if mover >= 0:
        share = min(share, free_share(x, y, dx, dy, w.x, w.y, reach))
    for k in range(c.num_obstacles):
        o = obstacles[k]
        share = min(share, free_share(x, y, dx, dy, o.x, o.y, c.radius + o.radius + BLOCKING_GAP))
    if c.walled:
        bound = c.half_arena - c.radius - BLOCKING_GAP
        share = min(share, free_share_wall(x, dx, bound), free_share_wall(y, dy, bound))
    return share


@compiled
def touches_surroundings(c: Record, robot: Record, obstacles: Records) -> bool:
    """Say whether a robot touches an obstacle or a wall."""
    inner = c.half_arena - c.radius - TOUCHING_GAP
    if c.walled and max(abs(robot.x), abs(robot.y)) >= inner:
        return True
    for k in range(c.num_obstacles):
        o = obstacles[k]
        dx, dy, reach = o.x - robot.x, o.y - robot.y, c.radius + o.radius + TOUCHING_GAP
        if dx * dx + dy * dy <= reach * reach:
            return True
    return False


@compiled
def meet(c: Record, w: Record, trackers: Records, obstacles: Records) -> None:
    """Work out who touches whom, count the contacts that begin, and flag who is near to anything.

    ``near`` marks robots that could touch something within the next control step; the others move
    without a sweep.
    """
    n = c.num_trackers
    touch = c.radius + c.radius + TOUCHING_GAP
    touch2 = touch * touch
    reach = touch + _TWO * c.tracker_speed * c.dt
    reach2 = reach * reach
    target_reach = touch + (c.tracker_speed + c.target_speed) * c.dt
    target_reach2 = target_reach * target_reach
    step = c.tracker_speed * c.dt
    least2 = (w.least_gap + c.radius + c.radius) * (w.least_gap + c.radius + c.radius)
    least = w.least_gap
    target_touching = _NO_BITS
    target_near = False
    for i in range(n):
        t = trackers[i]
        x, y = t.x, t.y
        before = t.touching_trackers
        touching = _NO_BITS
        near = False
        onsets = 0
        for j in range(n):
            if j == i:
                continue
            other = trackers[j]
            dx, dy = other.x - x, other.y - y
            d2 = dx * dx + dy * dy
            least2 = min(least2, d2)
            if d2 <= reach2:
                near = True
                if d2 <= touch2:
                    bit = _BIT << np.uint64(j)
                    touching |= bit
                    if before & bit == _NO_BITS:
                        onsets += 1
                        if i < j:
                            w.contacts_tracker += 1
        dx, dy = w.x - x, w.y - y
        d2 = dx * dx + dy * dy
        least2 = min(least2, d2)
        if d2 <= target_reach2:
            near = True
            target_near = True
            if d2 <= touch2:
                bit = _BIT << np.uint64(i)
                target_touching |= bit
                if w.touching & bit == _NO_BITS:
                    onsets += 1
                    w.contacts_target += 1
        surroundings = _NO_BITS
        for k in range(c.num_obstacles):
            o = obstacles[k]
            dx, dy = o.x - x, o.y - y
            d = c.radius + o.radius
            d2 = dx * dx + dy * dy
            if d2 < (d + least) * (d + least):
                least = np.float32(math.sqrt(d2)) - d
            if d2 <= (d + step + TOUCHING_GAP) * (d + step + TOUCHING_GAP):
                near = True
                gap = np.float32(math.sqrt(d2)) - d
                if gap <= TOUCHING_GAP:
                    surroundings |= _BIT << np.uint64(k)
        if c.walled:
            inner = c.half_arena - c.radius
            gap = inner - max(abs(x), abs(y))
            least = min(least, gap)
            if gap <= step + TOUCHING_GAP:
                near = True
                if inner - x <= TOUCHING_GAP:
                    surroundings |= _BIT << np.uint64(_FIRST_WALL)
                if inner + x <= TOUCHING_GAP:
                    surroundings |= _BIT << np.uint64(_FIRST_WALL + 1)
                if inner - y <= TOUCHING_GAP:
                    surroundings |= _BIT << np.uint64(_FIRST_WALL + 2)
                if inner + y <= TOUCHING_GAP:
                    surroundings |= _BIT << np.uint64(_FIRST_WALL + 3)
        begun = surroundings & ~t.touching_obstacles
        while begun != _NO_BITS:
            begun &= begun - _BIT
            onsets += 1
            w.contacts_obstacle += 1
        t.touching_trackers = touching
        t.touching_obstacles = surroundings
        t.near = near
        t.onsets = onsets
        in_touch = touching | surroundings | (target_touching & (_BIT << np.uint64(i)))
        t.touching = in_touch != _NO_BITS
    w.touching = target_touching
    w.near = target_near or c.num_obstacles > 0 or c.walled != 0
    w.least_gap = min(least, np.float32(math.sqrt(least2)) - c.radius - c.radius)
