"""The built-in target sensor, and fixes of the target."""

import math
from typing import Any, Final

import numpy as np

from posse.declarations import sensor
from posse.numeric import ONE, TINY, WIDTH, ZERO, Record, Records, compiled, root
from posse.numeric.lanes import bits, load
from posse.rules.discs import blocks
from posse.rules.kinematics import turned
from posse.rules.randomness import HEADING_NOISE, SENSOR_NOISE, normal_pair
from posse.rules.state import NEVER

_VELOCITY_MEMORY: Final = np.float32(1.0)  # s; older fixes give no velocity


@sensor("range-bearing")
def in_sight(c: Record, w: Record, t: Record, dx: np.float32, dy: np.float32, s: Record) -> bool:
    """Range and bearing of a target in sight.

    In sight: in range and in the field of view, not occluded, while the sensor works. Returns
    whether this holds for the target at (dx, dy) from a tracker.
    """
    d2 = dx * dx + dy * dy
    if d2 > c.sensing_range * c.sensing_range:
        return False
    if w.step >= t.sensor_dead_from and w.step < t.sensor_dead_from + c.outage_steps:
        return False
    if not c.all_round:
        along = dx * t.heading_cos + dy * t.heading_sin
        if along < c.view_cosine * root(d2):
            return False
    return not hidden(c, t, dx, dy, s)


@compiled
def hidden(c: Record, t: Record, dx: np.float32, dy: np.float32, s: Record) -> bool:
    """Return whether an obstacle occludes the point (dx, dy) from a tracker.

    In blocks of eight, since single branches would be mispredicted.
    """
    d2 = dx * dx + dy * dy
    first = c.num_trackers + 1
    for block in range(blocks(c.num_obstacles)):
        j = first + WIDTH * block
        ox, oy, radius = load(s.x, j) - t.x, load(s.y, j) - t.y, load(s.radius, j)
        along, across = ox * dx + oy * dy, ox * dy - oy * dx
        meets = (along > ZERO) & (along < d2) & (across * across < radius * radius * d2)
        if bits(meets) != 0:
            return True
    return False


@compiled
def fix_velocity(c: Record, t: Record, step: int, x: np.float32, y: np.float32) -> tuple[np.float32, np.float32]:
    """Return the target's velocity from a tracker's fix and a newer one at (x, y)."""
    since = np.float32(step - t.fix_step)
    if t.fix_step < 0 or since * c.control_step > _VELOCITY_MEMORY:
        return ZERO, ZERO
    rate = ONE / (since * c.control_step)
    vx, vy, keep = (x - t.fix.x) * rate, (y - t.fix.y) * rate, min(ONE, c.smoothing * since)
    vx, vy = t.fix.vx + keep * (vx - t.fix.vx), t.fix.vy + keep * (vy - t.fix.vy)
    # No target is faster than a tracker (assumption ii): limit the effect of noise.
    speed2 = vx * vx + vy * vy
    if speed2 > c.fastest * c.fastest:
        cut = c.fastest / root(max(speed2, TINY))
        vx, vy = vx * cut, vy * cut
    return vx, vy


@compiled
def take_fix(c: Record, t: Record, sender: Record) -> None:
    """Take a sender's newer fix, with the velocity from this and the previous one."""
    vx, vy = fix_velocity(c, t, sender.fix_step, sender.fix.x, sender.fix.y)
    t.fix_step, t.fix = sender.fix_step, sender.fix
    t.fix.vx, t.fix.vy = vx, vy


@compiled
def look(c: Record, w: Record, trackers: Records, odometry: Records, sees: Any, measure: Any, s: Record) -> int:
    """Read the target sensors and store fixes; return the number of trackers that see the target.

    Positions of discs are read from ``s`` (:func:`posse.rules.discs.lay_out`).
    """
    seeing = 0
    for i, t in enumerate(trackers):
        dx, dy = w.x - t.x, w.y - t.y
        t.sees = t.broken_at == NEVER and sees(c, w, t, dx, dy, s)
        if not t.sees:
            continue
        seeing += 1
        if c.measured:
            dx, dy = measure(c, w, i, dx, dy)
        own_x, own_y, cosine, sine = t.x, t.y, ONE, ZERO
        if c.drifts:  # what it measures is placed by its own pose, as it knows that
            own_x, own_y = t.x + odometry[i].x, t.y + odometry[i].y
            cosine, sine = odometry[i].cos, odometry[i].sin
            dx, dy = turned(dx, dy, cosine, sine)
        if c.fix_bearing:
            per_metre = ONE / max(root(dx * dx + dy * dy), TINY)
            t.fix.x, t.fix.y = dx * per_metre, dy * per_metre
            t.fix.cos, t.fix.sin, t.fix.frame_cos, t.fix.frame_sin = ZERO, ZERO, ZERO, ZERO
        else:
            x, y = own_x + dx, own_y + dy
            t.fix.vx, t.fix.vy = fix_velocity(c, t, w.step, x, y)
            t.fix.x, t.fix.y, t.fix.cos, t.fix.sin = x, y, w.heading_cos, w.heading_sin
            t.fix.frame_cos, t.fix.frame_sin = w.frame_cos, w.frame_sin
            if c.drifts or c.heading_noise > ZERO:
                noise = c.heading_noise * normal_pair(w.key, w.step, HEADING_NOISE, i)[0]
                cosine, sine = turned(cosine, sine, np.float32(math.cos(noise)), np.float32(math.sin(noise)))
                t.fix.cos, t.fix.sin = turned(t.fix.cos, t.fix.sin, cosine, sine)
                t.fix.frame_cos, t.fix.frame_sin = turned(t.fix.frame_cos, t.fix.frame_sin, cosine, sine)
        t.fix_step = w.step
    if seeing > 0 and w.detected_at < 0:
        w.detected_at = w.step
    return seeing


@compiled
def add_noise(c: Record, w: Record, number: int, dx: np.float32, dy: np.float32) -> tuple[np.float32, np.float32]:
    """Return the vector (dx, dy) from a tracker with the scenario's noise."""
    first, second = normal_pair(w.key, w.step, SENSOR_NOISE, number)
    scale = ONE + c.range_noise * first
    turn = c.bearing_noise * second
    dx, dy = turned(dx, dy, np.float32(math.cos(turn)), np.float32(math.sin(turn)))
    return scale * dx, scale * dy
