"""Positions of all discs of a world, laid out for processing in blocks of eight.

Discs (trackers, the target, obstacles) are stored in rows of a thread's scratch memory. Contact, motion, score, target
sensor and sonar read them in blocks of eight (:mod:`posse.numeric.lanes`); the padding of the last block is far away.
"""

from typing import Final

import numpy as np

from posse.numeric import ONE, WIDTH, Lanes, Record, Records, choose, compiled, eight, lesser, root
from posse.numeric.lanes import load, load_fields, store, transpose
from posse.rules.kinematics import in_frame
from posse.rules.state import BIT, NO_BITS, POSE_AT, Pose

TOUCHING_GAP: Final = np.float32(0.001)
"""Robots nearer than this touch, m."""

FAR: Final = np.float32(1e9)
"""Coordinate of padding and distance of what is not there, m: farther than any robot or range."""


@compiled
def blocks(count: int) -> int:
    """Return the number of blocks for ``count`` discs or beams; a range with a step of ``WIDTH`` is slower."""
    return (count + (WIDTH - 1)) >> 3


@compiled
def obstacle_within(obstacles: Records, x: np.float32, y: np.float32, reach: np.float32) -> bool:
    """Return whether the rim of an obstacle is nearer than ``reach`` to a point."""
    for o in obstacles:
        dx, dy, within = o.x - x, o.y - y, o.radius + reach
        if dx * dx + dy * dy < within * within:
            return True
    return False


@compiled
def to_wall(c: Record, x: np.float32, y: np.float32) -> np.float32:
    """Return the distance from a point to the nearest wall of the arena, m; far without an arena."""
    return np.float32(min(c.half_width - abs(x), c.half_height - abs(y)))


@compiled
def surroundings_within(c: Record, obstacles: Records, x: np.float32, y: np.float32, reach: np.float32) -> bool:
    """Return whether a wall, or the rim of an obstacle, is nearer than ``reach`` to a point."""
    return bool(to_wall(c, x, y) < reach or obstacle_within(obstacles, x, y, reach))


@compiled
def columns(records: Records, first: int, end: int, offset: int = 0) -> tuple[Lanes, ...]:
    """Return a block of eight fields of eight records, field by field, of which a named tuple is made.

    The records are those from ``first`` on; from ``end`` on, the one before is repeated. ``offset`` is where the block
    begins in a record, such as :data:`posse.rules.state.POSE_AT` for a :class:`posse.rules.state.Pose`.
    """
    last = end - 1
    rows = (
        load_fields(records[min(first, last)], offset),
        load_fields(records[min(first + 1, last)], offset),
        load_fields(records[min(first + 2, last)], offset),
        load_fields(records[min(first + 3, last)], offset),
        load_fields(records[min(first + 4, last)], offset),
        load_fields(records[min(first + 5, last)], offset),
        load_fields(records[min(first + 6, last)], offset),
        load_fields(records[min(first + 7, last)], offset),
    )
    return transpose(rows)


@compiled
def lay_out_robots(c: Record, w: Record, trackers: Records, s: Record) -> None:
    """Write the positions of all robots: trackers, then the target."""
    n = c.num_trackers
    for block in range(blocks(n + 1)):
        j = WIDTH * block
        pose = Pose(*columns(trackers, j, n, POSE_AT))
        number = load(s.index, j)
        tracker, target = number < np.float32(n), number == np.float32(n)
        store(s.x, j, choose(tracker, pose.x, choose(target, w.x, FAR)))
        store(s.y, j, choose(tracker, pose.y, choose(target, w.y, FAR)))


@compiled
def lay_out(c: Record, w: Record, trackers: Records, obstacles: Records, s: Record) -> None:
    """Write the positions of all discs: trackers, then the target, then obstacles."""
    # Padding first: a load of a block that covers two stores would have to wait for them.
    store(s.x, num_discs(c), eight(FAR))
    store(s.y, num_discs(c), eight(FAR))
    lay_out_robots(c, w, trackers, s)
    for k, o in enumerate(obstacles):
        j = c.num_trackers + 1 + k
        s.x[j], s.y[j], s.radius[j] = o.x, o.y, o.radius


@compiled
def num_discs(c: Record) -> int:
    """Return the number of discs of a world: trackers, the target, obstacles."""
    return int(c.num_trackers + 1 + c.num_obstacles)


@compiled
def find_gaps(c: Record, s: Record) -> None:
    """Write each tracker's gap to the nearest disc, and whether one is near (``excess`` ≤ 0).

    Near discs could be touched within the next control step.
    """
    n = c.num_trackers
    robots = c.robot_radius + c.robot_radius
    tracker_reach = robots + TOUCHING_GAP + (c.fastest + c.fastest) * c.control_step
    target_reach = robots + TOUCHING_GAP + (c.target_speed + c.fastest) * c.control_step
    margin = TOUCHING_GAP + c.fastest * c.control_step
    for block in range(blocks(n)):
        i = WIDTH * block
        x, y, number = load(s.x, i), load(s.y, i), load(s.index, i)
        # All robots have one radius, so the nearest is found without a square root for each.
        nearest2 = eight(FAR)
        for j in range(n):
            dx, dy = x - s.x[j], y - s.y[j]
            # s.index[j] is j; reading it is faster than converting j.
            d2 = choose(number == s.index[j], FAR, dx * dx + dy * dy)
            nearest2 = lesser(nearest2, d2)
        dx, dy = x - s.x[n], y - s.y[n]
        d2 = dx * dx + dy * dy
        excess = lesser(nearest2 - tracker_reach * tracker_reach, d2 - target_reach * target_reach)
        least = root(lesser(nearest2, d2)) - robots
        for j in range(n + 1, num_discs(c)):
            dx, dy = x - s.x[j], y - s.y[j]
            gap = root(dx * dx + dy * dy) - (c.robot_radius + s.radius[j])
            least, excess = lesser(least, gap), lesser(excess, gap - margin)
        store(s.gap, i, least)
        store(s.excess, i, excess)


@compiled
def find_slots(c: Record, w: Record, slots: Records, taken: np.uint64, s: Record) -> None:
    """Write each tracker's nearest slot that is not in the bit set ``taken``, and its distance; -1: all are taken."""
    for block in range(blocks(c.num_trackers)):
        i = WIDTH * block
        ahead, left = in_frame(load(s.x, i) - w.x, load(s.y, i) - w.y, w.frame_cos, w.frame_sin)
        nearest, nearest2 = eight(-ONE), eight(FAR)
        for slot in range(c.num_trackers):
            if taken & (BIT << np.uint64(slot)) == NO_BITS:
                dx, dy = ahead - slots[slot].x, left - slots[slot].y
                d2 = dx * dx + dy * dy
                nearest = choose(d2 < nearest2, s.index[slot], nearest)
                nearest2 = lesser(nearest2, d2)
        store(s.slot, i, nearest)
        store(s.slot_distance2, i, nearest2)
        store(s.slot_distance, i, root(nearest2))
