"""What is near a tracker, as discs for the safeguard: read off the state."""

from __future__ import annotations

from typing import Final

from posse.numeric import Record, Records, compiled
from posse_baselines.laws.safeguard import put_disc, put_wall

_NEAR: Final = 3.0  # m; farther things are no danger yet


@compiled
def surround(c: Record, w: Record, trackers: Records, obstacles: Records, i: int, margin: float, discs: Records) -> int:
    """List what is near tracker i; return how many things that are.

    ``margin`` (m) is the free width to keep; twice as much to the target.
    """
    t = trackers[i]
    count, two = 0, 2.0 * c.radius
    dx, dy = w.x - t.x, w.y - t.y
    if dx * dx + dy * dy < _NEAR * _NEAR:
        vx, vy = w.speed * w.heading_cos, w.speed * w.heading_sin
        count = put_disc(discs, count, dx, dy, vx, vy, two, 2.0 * margin)
    for j in range(c.num_trackers):
        other = trackers[j]
        dx, dy = other.x - t.x, other.y - t.y
        if j != i and dx * dx + dy * dy < _NEAR * _NEAR:
            vx, vy = other.speed * other.heading_cos, other.speed * other.heading_sin
            count = put_disc(discs, count, dx, dy, vx, vy, two, margin)
    for k in range(c.num_obstacles):
        o = obstacles[k]
        dx, dy = o.x - t.x, o.y - t.y
        reach = o.radius + c.radius
        if dx * dx + dy * dy < (_NEAR + reach) * (_NEAR + reach):
            count = put_disc(discs, count, dx, dy, 0.0, 0.0, reach, margin)
    if c.walled:
        half = c.half_arena
        if half - t.x < _NEAR:
            count = put_wall(discs, count, half - t.x, 1.0, 0.0, c.radius, margin)
        if half + t.x < _NEAR:
            count = put_wall(discs, count, half + t.x, -1.0, 0.0, c.radius, margin)
        if half - t.y < _NEAR:
            count = put_wall(discs, count, half - t.y, 0.0, 1.0, c.radius, margin)
        if half + t.y < _NEAR:
            count = put_wall(discs, count, half + t.y, 0.0, -1.0, c.radius, margin)
    return count
