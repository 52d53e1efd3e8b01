"""Contact: no disc enters or passes through another, at any speed.

Robots move sequentially, target first. Each move is swept along the chord of its arc and stops
before contact with another disc or a wall; a blocked robot stays in place until its heading is
free. A contact is counted once, when it begins, and by kind.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from posse.numeric import (
    ONE,
    ZERO,
    FloatArray,
    Lanes,
    Record,
    Records,
    bits,
    choose,
    compiled,
    greater,
    least,
    lesser,
    load,
    root,
)
from posse.rules.discs import A_LITTLE_MORE, BLOCK, FAR, TOUCHING_GAP, blocks, natural, obstacle_within
from posse.rules.state import BIT, NO_BITS

BLOCKING_GAP: Final = np.float32(0.0005)
"""Width of the gap at which a move stops, m."""

_SURELY_APART: Final = np.float32(0.01)  # m; far more than a touch and all rounding

_TINY: Final = np.float32(1e-30)  # m²; a move so short meets nothing
_FIRST_WALL: Final = 60


@compiled
def free_share(
    x: np.float32, y: np.float32, dx: np.float32, dy: np.float32, other_x: Lanes, other_y: Lanes, reach: Lanes
) -> Lanes:
    """Return the share of a straight move, 0 to 1, until a point is within ``reach`` of another.

    The other is one point, or a block of eight.
    """
    rx, ry = x - other_x, y - other_y
    closing = rx * dx + ry * dy
    gap = rx * rx + ry * ry - reach * reach
    length = dx * dx + dy * dy
    under_root = closing * closing - length * gap
    until = (ZERO - closing - root(greater(under_root, ZERO))) / greater(length, _TINY)
    share = choose(gap <= ZERO, ZERO, choose(under_root <= ZERO, ONE, lesser(ONE, until)))
    return choose(closing >= ZERO, ONE, share)


@compiled
def free_share_wall(x: np.float32, dx: np.float32, bound: np.float32) -> np.float32:
    """Return the share of a move along one axis that stays within ±bound."""
    if dx > ZERO and x + dx > bound:
        return max(ZERO, (bound - x) / dx)
    if dx < ZERO and x + dx < -bound:
        return max(ZERO, (-bound - x) / dx)
    return ONE


@compiled
def free_of_robots(
    c: Record, x: np.float32, y: np.float32, dx: np.float32, dy: np.float32, xs: FloatArray, ys: FloatArray, count: int
) -> np.float32:
    """Return the share of a robot's move that no other robot blocks.

    The positions of ``count`` robots are in ``xs`` and ``ys``; the robot itself may be among them.
    """
    reach = c.radius + c.radius + BLOCKING_GAP
    within = (reach + abs(dx) + abs(dy)) * A_LITTLE_MORE
    share = ONE
    for block in range(blocks(count)):
        other_x, other_y = load(xs, BLOCK * block), load(ys, BLOCK * block)
        rx, ry = x - other_x, y - other_y
        if bits((rx * rx + ry * ry < within * within) & (rx * dx + ry * dy < ZERO)) != 0:
            share = min(share, least(free_share(x, y, dx, dy, other_x, other_y, reach)))
    return np.float32(share)


@compiled
def free_of_surroundings(
    c: Record, obstacles: Records, x: np.float32, y: np.float32, dx: np.float32, dy: np.float32
) -> np.float32:
    """Return the share of a robot's move that neither obstacles nor walls block."""
    share = ONE
    for k in range(c.num_obstacles):
        o = obstacles[k]
        share = min(share, free_share(x, y, dx, dy, o.x, o.y, c.radius + o.radius + BLOCKING_GAP))
    if c.walled:
        bound = c.half_arena - c.radius - BLOCKING_GAP
        share = min(share, free_share_wall(x, dx, bound), free_share_wall(y, dy, bound))
    return share


@compiled
def touches_surroundings(c: Record, robot: Record, obstacles: Records) -> bool:
    """Return whether a robot touches an obstacle or a wall."""
    inner = c.half_arena - c.radius - TOUCHING_GAP
    if c.walled and max(abs(robot.x), abs(robot.y)) >= inner:
        return True
    return obstacle_within(obstacles, c.num_obstacles, robot.x, robot.y, c.radius + TOUCHING_GAP)


@compiled
def meet(c: Record, w: Record, trackers: Records, obstacles: Records, s: Record) -> None:
    """Find contacts, count those that begin, and mark robots with something near.

    ``near`` marks robots that could touch something within the next control step; the others move
    without a sweep. Gaps are read from ``s`` (:func:`posse.rules.discs.find_gaps`).
    """
    inner = c.half_arena - c.radius
    smallest, before = w.least_gap, w.contacts_target
    target_touching, target_near = NO_BITS, False
    for i in range(c.num_trackers):
        t = trackers[i]
        wall = FAR
        if c.walled:
            wall = inner - max(abs(t.x), abs(t.y))
        smallest = min(smallest, s.gap[i], wall)
        wall_near = wall <= t.max_speed * c.dt + TOUCHING_GAP
        near = s.excess[i] <= ZERO or wall_near
        if not near:
            if t.near:
                t.touching_trackers, t.touching_obstacles = NO_BITS, NO_BITS
                t.near, t.touching, t.onsets = 0, 0, 0
            continue
        t.near, t.onsets = 1, 0
        target_near = target_near or near_target(c, w, t)
        if min(s.gap[i], wall) > _SURELY_APART:
            t.touching_trackers, t.touching_obstacles, t.touching = NO_BITS, NO_BITS, 0
        elif meet_closely(c, w, t, obstacles, i, s):
            target_touching |= BIT << np.uint64(i)
    w.touching = target_touching
    w.onsets = w.contacts_target - before
    w.near = target_near
    if c.walled and not target_near:
        w.near = c.target_agent != 0 or target_near_surroundings(c, w, s)
    w.least_gap = smallest


@compiled(out_of_line=True)
def meet_closely(c: Record, w: Record, t: Record, obstacles: Records, i: int, s: Record) -> bool:
    """Find the contacts of a tracker with something near; return whether it touches the target."""
    touches_target = meet_target(c, w, t, i)
    meet_trackers(c, w, t, i, s)
    meet_surroundings(c, w, t, obstacles)
    t.touching = touches_target or (t.touching_trackers | t.touching_obstacles) != NO_BITS
    return bool(touches_target)


@compiled
def near_target(c: Record, w: Record, t: Record) -> bool:
    """Return whether a tracker and the target could touch within the next control step."""
    reach = c.radius + c.radius + TOUCHING_GAP + (t.max_speed + c.target_speed) * c.dt
    dx, dy = w.x - t.x, w.y - t.y
    return bool(dx * dx + dy * dy <= reach * reach)


@compiled
def target_near_surroundings(c: Record, w: Record, s: Record) -> bool:
    """Return whether the target could touch an obstacle or a wall within the next control step.

    Positions of obstacles are read from scratch memory (:func:`posse.rules.discs.lay_out`).
    """
    # A scripted target rarely comes so near: after trackers blocked it (walls.way_out), or if it
    # crosses its clearance within a control step.
    way = TOUCHING_GAP + c.target_speed * c.dt
    if c.half_arena - c.radius - max(abs(w.x), abs(w.y)) <= way:
        return True
    first = natural(c.num_trackers) + 1
    for block in range(blocks(c.num_obstacles)):
        k = first + BLOCK * block
        dx, dy, reach = load(s.x, k) - w.x, load(s.y, k) - w.y, load(s.radius, k)
        reach = reach + (c.radius + way)
        if bits(dx * dx + dy * dy <= reach * reach) != 0:
            return True
    return False


@compiled
def meet_target(c: Record, w: Record, t: Record, i: int) -> bool:
    """Return whether tracker i touches the target, and count the contact if it begins."""
    touch = c.radius + c.radius + TOUCHING_GAP
    dx, dy = w.x - t.x, w.y - t.y
    if dx * dx + dy * dy > touch * touch:
        return False
    if w.touching & (BIT << np.uint64(i)) == NO_BITS:
        t.onsets += 1
        w.contacts_target += 1
    return True


@compiled
def meet_trackers(c: Record, w: Record, t: Record, i: int, s: Record) -> None:
    """Note which other trackers tracker i touches, and count the contacts that begin."""
    touch = c.radius + c.radius + TOUCHING_GAP
    touching = 0
    for block in range(blocks(c.num_trackers)):
        j = BLOCK * block
        dx, dy = load(s.x, j) - t.x, load(s.y, j) - t.y
        other = load(s.index, j) < np.float32(c.num_trackers)
        touching |= bits((dx * dx + dy * dy <= touch * touch) & other) << j
    now = np.uint64(touching) & ~(BIT << np.uint64(i))
    begun = now & ~t.touching_trackers
    while begun != NO_BITS:
        first = begun & (~begun + BIT)
        begun ^= first
        t.onsets += 1
        if first > BIT << np.uint64(i):
            w.contacts_tracker += 1
    t.touching_trackers = now


@compiled
def meet_surroundings(c: Record, w: Record, t: Record, obstacles: Records) -> None:
    """Note which obstacles and walls a tracker touches, and count the contacts that begin."""
    touching = NO_BITS
    for k in range(c.num_obstacles):
        o = obstacles[k]
        dx, dy, reach = o.x - t.x, o.y - t.y, c.radius + o.radius + TOUCHING_GAP
        if dx * dx + dy * dy <= reach * reach:
            touching |= BIT << np.uint64(k)
    if c.walled:
        inner = c.half_arena - c.radius - TOUCHING_GAP
        if t.x >= inner:
            touching |= BIT << np.uint64(_FIRST_WALL)
        if t.x <= -inner:
            touching |= BIT << np.uint64(_FIRST_WALL + 1)
        if t.y >= inner:
            touching |= BIT << np.uint64(_FIRST_WALL + 2)
        if t.y <= -inner:
            touching |= BIT << np.uint64(_FIRST_WALL + 3)
    begun = touching & ~t.touching_obstacles
    while begun != NO_BITS:
        begun &= begun - BIT
        t.onsets += 1
        w.contacts_obstacle += 1
    t.touching_obstacles = touching
