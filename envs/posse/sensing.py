"""What a tracker senses by itself: the target, if in sight, and the sonar ring."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from posse.arrays import FloatArray, Record, Records
from posse.compiled import compiled
from posse.randomness import SENSOR_NOISE, normal_pair
from posse.state import NEVER

_ZERO: Final = np.float32(0.0)
_ONE: Final = np.float32(1.0)
_FAR: Final = np.float32(1e9)
_VELOCITY_MEMORY: Final = np.float32(1.0)  # s; an older fix tells nothing of the velocity


@compiled
def in_sight(
    c: Record, w: Record, t: Record, obstacles: Records, dx: np.float32, dy: np.float32
) -> bool:
    """Say whether a tracker's sensor has the target, which lies (dx, dy) from it.

    In range, in the field of view, the sensor alive, and no obstacle across the line of sight.
    """
    d2 = dx * dx + dy * dy
    if d2 > c.sensing_range * c.sensing_range:
        return False
    if w.step >= t.sensor_dead_from and w.step < t.sensor_dead_from + c.outage_steps:
        return False
    if c.all_round == 0:
        along = dx * t.heading_cos + dy * t.heading_sin
        if along < c.view_cosine * np.float32(math.sqrt(d2)):
            return False
    for k in range(c.num_obstacles):
        o = obstacles[k]
        ox, oy = o.x - t.x, o.y - t.y
        along = ox * dx + oy * dy
        if along > _ZERO and along < d2:
            across = ox * dy - oy * dx
            if across * across < o.radius * o.radius * d2:
                return False
    return True


@compiled
def take_fix(
    c: Record,
    t: Record,
    step: int,
    x: np.float32,
    y: np.float32,
    heading_cos: np.float32,
    heading_sin: np.float32,
    frame_cos: np.float32,
    frame_sin: np.float32,
) -> None:
    """Give a tracker a newer fix of the target, and a velocity from this and the one before."""
    steps = step - t.fix_step
    if t.fix_step >= 0 and np.float32(steps) * c.dt <= _VELOCITY_MEMORY:
        time = np.float32(steps) * c.dt
        vx, vy = (x - t.fix_x) / time, (y - t.fix_y) / time
        keep = min(_ONE, c.smoothing * np.float32(steps))
        vx, vy = t.fix_vx + keep * (vx - t.fix_vx), t.fix_vy + keep * (vy - t.fix_vy)
        # No target is faster than a tracker (assumption ii), so noise that says so is cut.
        speed = np.float32(math.sqrt(vx * vx + vy * vy))
        if speed > c.tracker_speed:
            vx, vy = vx * (c.tracker_speed / speed), vy * (c.tracker_speed / speed)
        t.fix_vx, t.fix_vy = vx, vy
    else:
        t.fix_vx, t.fix_vy = _ZERO, _ZERO
    t.fix_step = step
    t.fix_x, t.fix_y = x, y
    t.fix_cos, t.fix_sin = heading_cos, heading_sin
    t.fix_frame_cos, t.fix_frame_sin = frame_cos, frame_sin


@compiled
def look(c: Record, w: Record, t: Record, obstacles: Records, number: int) -> None:
    """Let a tracker look for the target, and note the fix if it has it."""
    dx, dy = w.x - t.x, w.y - t.y
    t.sees = t.broken_at == NEVER and in_sight(c, w, t, obstacles, dx, dy)
    if not t.sees:
        return
    if w.detected_at < 0:
        w.detected_at = w.step
    if c.range_noise > _ZERO or c.bearing_noise > _ZERO:
        first, second = normal_pair(w.key, w.step, SENSOR_NOISE, number)
        scale = _ONE + c.range_noise * first
        turn = c.bearing_noise * second
        cosine, sine = np.float32(math.cos(turn)), np.float32(math.sin(turn))
        dx, dy = scale * (dx * cosine - dy * sine), scale * (dx * sine + dy * cosine)
    take_fix(
        c, t, w.step, t.x + dx, t.y + dy,
        w.heading_cos, w.heading_sin, w.frame_cos, w.frame_sin,
    )  # fmt: skip


@compiled
def listen_to_disc(
    c: Record,
    ex: np.float32,
    ey: np.float32,
    radius: np.float32,
    beams: FloatArray,
    readings: FloatArray,
) -> None:
    """Shorten the sonar readings (S,) by a disc whose centre lies (ex, ey) ahead and to the left.

    The disc's nearest point counts for the beam in whose width it lies; for any other beam, where
    its axis meets the disc. Without branches, so that the compiler does several beams at once.
    """
    reach = c.sonar_range + c.radius + radius
    d2 = ex * ex + ey * ey
    if d2 >= reach * reach:
        return
    distance = np.float32(math.sqrt(d2))
    in_width = c.beam_cosine * distance
    nearest = distance - radius - c.radius
    radius2, own = radius * radius, c.radius
    for k in range(len(readings)):
        along = ex * beams[0, k] + ey * beams[1, k]
        across = ey * beams[0, k] - ex * beams[1, k]
        under_root = radius2 - across * across
        axis = along - np.float32(math.sqrt(max(under_root, _ZERO))) - own
        axis = axis if under_root > _ZERO and along > _ZERO else _FAR
        found = nearest if along >= in_width else axis
        readings[k] = min(readings[k], found)


@compiled
def listen_to_wall(
    c: Record,
    robot: Record,
    normal_x: np.float32,
    normal_y: np.float32,
    distance: np.float32,
    beams: FloatArray,
    readings: FloatArray,
) -> None:
    """Shorten the sonar readings (S,) by a wall at a distance along its outward normal."""
    if distance >= c.sonar_range + c.radius:
        return
    ahead = normal_x * robot.heading_cos + normal_y * robot.heading_sin
    left = normal_y * robot.heading_cos - normal_x * robot.heading_sin
    for k in range(len(readings)):
        towards = ahead * beams[0, k] + left * beams[1, k]
        if towards >= c.beam_cosine:
            readings[k] = min(readings[k], distance - c.radius)
        elif towards > _ZERO:
            readings[k] = min(readings[k], distance / towards - c.radius)


@compiled
def ping(
    c: Record,
    w: Record,
    robot: Record,
    number: int,
    trackers: Records,
    obstacles: Records,
    beams: FloatArray,
    readings: FloatArray,
) -> None:
    """Write the sonar ring of a robot (number -1: the target), (S,) metres from its rim.

    ``beams`` (2, S) holds the cosine and sine of each beam's direction in the robot's frame.
    """
    for k in range(len(readings)):
        readings[k] = c.sonar_range
    hc, hs, x, y = robot.heading_cos, robot.heading_sin, robot.x, robot.y
    for j in range(c.num_trackers):
        if j != number:
            dx, dy = trackers[j].x - x, trackers[j].y - y
            listen_to_disc(c, dx * hc + dy * hs, dy * hc - dx * hs, c.radius, beams, readings)
    if number >= 0:
        dx, dy = w.x - x, w.y - y
        listen_to_disc(c, dx * hc + dy * hs, dy * hc - dx * hs, c.radius, beams, readings)
    for k in range(c.num_obstacles):
        o = obstacles[k]
        dx, dy = o.x - x, o.y - y
        listen_to_disc(c, dx * hc + dy * hs, dy * hc - dx * hs, o.radius, beams, readings)
    if c.walled:
        half = c.half_arena
        listen_to_wall(c, robot, _ONE, _ZERO, half - x, beams, readings)
        listen_to_wall(c, robot, -_ONE, _ZERO, half + x, beams, readings)
        listen_to_wall(c, robot, _ZERO, _ONE, half - y, beams, readings)
        listen_to_wall(c, robot, _ZERO, -_ONE, half + y, beams, readings)
    for k in range(len(readings)):
        readings[k] = max(readings[k], _ZERO)
