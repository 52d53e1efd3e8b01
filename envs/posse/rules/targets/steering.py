"""Steering of a scripted target: turns to its goal heading within its turn limit, clear of walls and obstacles.

In an arena the goal is mirrored near walls, and only turns that leave one of the two turning
circles free are taken, so that the target can always keep turning without contact. If trackers
block the target, which then turns on the spot, both circles may be occupied: then it turns to the
wider side until one is free, and contacts stop it (:mod:`posse.rules.contact`).
"""

from typing import Any, Final

import numpy as np

from posse.numeric import HALF, ONE, ZERO, Record, Records, compiled, root
from posse.rules.discs import surroundings_within, to_wall
from posse.rules.kinematics import arc, turn_towards

ROUNDING: Final = np.float32(1e-3)  # m, far more than that of a given pose, or accumulated in an episode
_SOFT_WALL: Final = np.float32(2.0)  # m; distance to a wall at which goals are mirrored


@compiled
def target_turn_rate(
    c: Record, w: Record, trackers: Records, obstacles: Records, set_goal: Any, s: Record
) -> np.float32:
    """Return the turn rate of a scripted target for the next control step, rad/s."""
    set_goal(c, w, trackers, obstacles, s)
    if c.mirrored:
        mirror_at_walls(c, w)
    turn = turn_towards(w.heading_cos, w.heading_sin, w.goal_cos, w.goal_sin, c.target_turn_rate, c.control_step)
    if c.walled:
        turn = safe_turn(c, w, obstacles, turn)
    return turn


@compiled
def mirror_at_walls(c: Record, w: Record) -> None:
    """Mirror the goal heading at a wall that is near and ahead."""
    inner = max(c.half_width - _SOFT_WALL, c.half_width * HALF)
    if (w.x > inner and w.goal_cos > ZERO) or (w.x < -inner and w.goal_cos < ZERO):
        w.goal_cos = -w.goal_cos
    inner = max(c.half_height - _SOFT_WALL, c.half_height * HALF)
    if (w.y > inner and w.goal_sin > ZERO) or (w.y < -inner and w.goal_sin < ZERO):
        w.goal_sin = -w.goal_sin


@compiled
def free_circles(
    c: Record,
    obstacles: Records,
    x: np.float32,
    y: np.float32,
    heading_cos: np.float32,
    heading_sin: np.float32,
    allowance: np.float32,
) -> tuple[bool, bool]:
    """Return whether the turning circles on the left and on the right are free, but for an allowance, m."""
    radius = c.target_speed / c.target_turn_rate
    aside_x, aside_y, room = radius * heading_sin, radius * heading_cos, radius - allowance + c.safe_distance
    left = not surroundings_within(c, obstacles, x - aside_x, y + aside_y, room)
    return left, not surroundings_within(c, obstacles, x + aside_x, y - aside_y, room)


@compiled
def safe_turn(c: Record, w: Record, obstacles: Records, turn: np.float32) -> np.float32:
    """Return ``turn`` if a free turning circle remains after it, else the turn along a free one.

    If there is none, the turn that leads to one.
    """
    dx, dy, hc, hs = w.heading_cos, w.heading_sin, w.heading_cos, w.heading_sin
    x, y = w.x, w.y
    for _ in range(c.physics_steps):
        dx, dy, hc, hs = arc(hc, hs, c.target_speed, turn, c.physics_step)
        x, y = x + dx, y + dy
    left, right = free_circles(c, obstacles, x, y, hc, hs, ZERO)
    if left or right:
        return turn
    # Allow for rounding, so that the target does not change sides on a free circle.
    left, right = free_circles(c, obstacles, w.x, w.y, w.heading_cos, w.heading_sin, ROUNDING)
    if left and (turn >= ZERO or not right):
        side = ONE
    elif right:
        side = -ONE
    else:
        side = way_out(c, w, obstacles)
    return np.float32(side * c.target_turn_rate)


@compiled
def way_out(c: Record, w: Record, obstacles: Records) -> np.float32:
    """Return the side (+1 left, -1 right) to turn to if neither turning circle is free."""
    if w.speed == ZERO:
        # Blocked in the last step: keep turning the same way, which reaches every heading, whereas
        # alternating could last forever.
        return ONE if w.turn_rate >= ZERO else -ONE
    radius = c.target_speed / c.target_turn_rate
    aside_x, aside_y = -radius * w.heading_sin, radius * w.heading_cos
    left = width_around(c, obstacles, w.x + aside_x, w.y + aside_y)
    right = width_around(c, obstacles, w.x - aside_x, w.y - aside_y)
    return ONE if left >= right else -ONE


@compiled
def width_around(c: Record, obstacles: Records, x: np.float32, y: np.float32) -> np.float32:
    """Return the distance from a point to the nearest obstacle or wall, m."""
    width = to_wall(c, x, y)
    for o in obstacles:
        dx, dy = o.x - x, o.y - y
        width = min(width, root(dx * dx + dy * dy) - o.radius)
    return np.float32(width)
