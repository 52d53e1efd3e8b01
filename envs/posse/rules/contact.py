"""Contact: no disc enters or passes through another, at any speed.

Robots near something move sequentially, target first. Each move is swept along the chord of its arc and stops
before contact with another disc or a wall; a blocked robot stays in place until its heading is
free. A contact is counted once, when it begins, and by kind.
"""

from typing import Final

import numpy as np

from posse.numeric import ONE, WIDTH, ZERO, Lanes, Record, Records, choose, compiled, greater, lesser, root
from posse.numeric.lanes import bits, least, load
from posse.rules.discs import TOUCHING_GAP, blocks, surroundings_within
from posse.rules.state import BIT, NO_BITS
from posse.scenarios.scenario import MAX_OBSTACLES

BLOCKING_GAP: Final = np.float32(0.0005)
"""Width of the gap at which a move stops, m."""

_TINY: Final = np.float32(1e-30)  # m²; a move so short meets nothing


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
def free_of_robots(c: Record, x: np.float32, y: np.float32, dx: np.float32, dy: np.float32, s: Record) -> np.float32:
    """Return the share of a robot's move that no other robot blocks.

    The positions of all robots, itself among them, are in ``s`` (:func:`posse.rules.discs.lay_out_robots`).
    """
    reach, share = c.robot_radius + c.robot_radius + BLOCKING_GAP, ONE
    for block in range(blocks(c.num_trackers + 1)):
        k = WIDTH * block
        share = min(share, least(free_share(x, y, dx, dy, load(s.x, k), load(s.y, k), reach)))
    return np.float32(share)


@compiled
def free_of_surroundings(
    c: Record, obstacles: Records, x: np.float32, y: np.float32, dx: np.float32, dy: np.float32
) -> np.float32:
    """Return the share of a robot's move that neither obstacles nor walls block."""
    share = ONE
    for o in obstacles:
        share = min(share, free_share(x, y, dx, dy, o.x, o.y, c.robot_radius + o.radius + BLOCKING_GAP))
    if c.walled:
        share = min(share, free_share_wall(x, dx, c.half_width - c.robot_radius - BLOCKING_GAP))
        share = min(share, free_share_wall(y, dy, c.half_height - c.robot_radius - BLOCKING_GAP))
    return share


@compiled
def find_contacts(c: Record, w: Record, trackers: Records, obstacles: Records, s: Record) -> None:
    """Find contacts, count those that begin, and mark robots with something near.

    ``near`` marks robots that could touch something within the next control step; the others move
    without a sweep. Gaps are read from ``s`` (:func:`posse.rules.discs.find_gaps`).
    """
    inner_x, inner_y = c.half_width - c.robot_radius, c.half_height - c.robot_radius
    touch = c.robot_radius + c.robot_radius + TOUCHING_GAP
    smallest, before = w.least_gap, w.contacts_target
    target_touching, target_near = NO_BITS, False
    for i, t in enumerate(trackers):
        wall = min(inner_x - abs(t.x), inner_y - abs(t.y))
        smallest = min(smallest, s.gap[i], wall)
        wall_near = wall <= t.max_speed * c.control_step + TOUCHING_GAP
        t.near, t.onsets = s.excess[i] <= ZERO or wall_near, 0
        if t.near:
            dx, dy, reach = w.x - t.x, w.y - t.y, touch + (t.max_speed + c.target_speed) * c.control_step
            target_near = target_near or dx * dx + dy * dy <= reach * reach
            if contacts_of(c, w, t, obstacles, i, s):
                target_touching |= BIT << np.uint64(i)
        else:
            t.touching_trackers, t.touching_obstacles, t.touching = NO_BITS, NO_BITS, 0
    w.touching = target_touching
    w.onsets = w.contacts_target - before
    w.near = target_near
    if c.target_is_agent:
        reach = c.robot_radius + TOUCHING_GAP
        w.in_contact = target_touching != NO_BITS or surroundings_within(c, obstacles, w.x, w.y, reach)
    if c.walled and not target_near:
        # A scripted target rarely comes so near: after trackers blocked it (steering.way_out), or if it
        # crosses its clearance within a control step.
        way = TOUCHING_GAP + c.target_speed * c.control_step
        w.near = c.target_is_agent or surroundings_within(c, obstacles, w.x, w.y, c.robot_radius + way)
    w.least_gap = smallest


@compiled
def count_bits(mask: np.uint64) -> int:
    """Return the number of bits that are set."""
    count = 0
    while mask != NO_BITS:
        mask &= mask - BIT
        count += 1
    return count


@compiled
def contacts_of(c: Record, w: Record, t: Record, obstacles: Records, i: int, s: Record) -> bool:
    """Find the contacts of tracker i with something near; return whether it touches the target."""
    bit, touch = BIT << np.uint64(i), c.robot_radius + c.robot_radius + TOUCHING_GAP
    # The target.
    dx, dy = w.x - t.x, w.y - t.y
    touches_target = dx * dx + dy * dy <= touch * touch
    if touches_target and w.touching & bit == NO_BITS:
        t.onsets += 1
        w.contacts_target += 1
    # Other trackers.
    found = 0
    for block in range(blocks(c.num_trackers)):
        j = WIDTH * block
        x, y = load(s.x, j) - t.x, load(s.y, j) - t.y
        other = load(s.index, j) < np.float32(c.num_trackers)
        found |= bits((x * x + y * y <= touch * touch) & other) << j
    touching = np.uint64(found) & ~bit
    begun = touching & ~t.touching_trackers
    t.onsets += count_bits(begun)
    w.contacts_tracker += count_bits(begun >> np.uint64(i))  # each pair once
    t.touching_trackers = touching
    # Obstacles and walls.
    touching = NO_BITS
    for k, o in enumerate(obstacles):
        dx, dy, reach = o.x - t.x, o.y - t.y, c.robot_radius + o.radius + TOUCHING_GAP
        if dx * dx + dy * dy <= reach * reach:
            touching |= BIT << np.uint64(k)
    if c.walled:
        for k, along in enumerate((t.x, -t.x, t.y, -t.y)):
            if along >= (c.half_width if k < 2 else c.half_height) - c.robot_radius - TOUCHING_GAP:
                touching |= BIT << np.uint64(MAX_OBSTACLES + k)  # the last bits
    begun = count_bits(touching & ~t.touching_obstacles)
    t.onsets += begun
    w.contacts_obstacle += begun
    t.touching_obstacles = touching
    t.touching = touches_target or (t.touching_trackers | touching) != NO_BITS
    return bool(touches_target)
